"""The results of a run as lines for the terminal."""

from collections.abc import Mapping, Sequence

from lab.results import ScenarioResult, Verdict

_RULE_OF_THREE = 3.0  # 95 % upper bound on the expected count if none was observed


def figures_line(figures: Mapping[str, str]) -> str:
    """Return figures as one line of text."""
    return "; ".join(f"{name}: {value}" for name, value in figures.items())


def result_line(result: ScenarioResult) -> str:
    """Return a result as one line of the terminal's table."""
    words = result.reason or figures_line(result.figures)
    # The last line of a traceback holds the error.
    last = words.strip().splitlines()[-1:] or [""]
    seconds = f"{result.seconds:8.2f} s {result.processor:7.1f} s"
    return f"{result.verdict.value:<10} {result.name:<28} {seconds}  {last[0]}"


def summary(results: Sequence[ScenarioResult], wall: float) -> str:
    """Return the last line: number of scenarios by verdict, and wall time [s]."""
    counts = {
        verdict: sum(result.verdict is verdict for result in results)
        for verdict in Verdict
    }
    parts = [f"{n} {verdict.value}" for verdict, n in counts.items() if n]
    return f"{', '.join(parts) or 'nothing ran'} in {wall:.0f} s of wall time"


def missed_cycles_line(results: Sequence[ScenarioResult]) -> str:
    """Return a line on the missed cycles of all kept trials, with a 95 % bound."""
    rows = [result.figures for result in results if "cycles" in result.figures]
    cycles = sum(int(row["cycles"]) for row in rows)
    missed = sum(int(row["missed"]) for row in rows)
    if not cycles:
        return "No trial was kept."
    words = f"{missed} of {cycles} cycles of kept trials were missed"
    if missed:
        return f"{words}: {missed / cycles * 1e6:.0f} ppm."
    bound = _RULE_OF_THREE / cycles * 1e6
    return f"{words}: below {bound:.0f} ppm with 95 % confidence."
