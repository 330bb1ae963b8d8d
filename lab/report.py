"""The table of verdicts: on the terminal, and as docs/lab.md."""

from collections.abc import Mapping, Sequence

from lab.results import ScenarioResult, Verdict

_TITLE = "# The program beside the real kernel's drivers\n"
_HEAD = """
Made by `make lab-page` (`python -m lab --write docs/lab.md`). Each scenario runs the
unmodified program in an emulated machine: Debian's kernel, its `kvaser_pci` (SJA1000)
and `ftdi_sio` drivers, `can0` and `/dev/ttyUSB0` as on the rig; the simulated arm is on
`can1`, the simulated sensor at the far end of the serial adapter. All times are guest
time: the machine's clock follows the instructions it executes, so a busy host changes
none of them. Bit time, arbitration, missing acknowledgement and bus-off are not in this
emulated bus.

| scenario | verdict | guest time s | figures |
|---|---|---|---|
"""


def figure_words(figures: Mapping[str, str]) -> str:
    """Return figures in one line."""
    return "; ".join(f"{name}: {value}" for name, value in figures.items())


def result_line(result: ScenarioResult) -> str:
    """Return a result as one line of the terminal's table."""
    words = result.reason or figure_words(result.figures)
    # A traceback says what it is in its last line.
    last = words.strip().splitlines()[-1:] or [""]
    seconds = f"{result.seconds:8.2f} s"
    return f"{result.verdict.value:<10} {result.name:<28} {seconds}  {last[0]}"


def summary(results: Sequence[ScenarioResult], wall: float) -> str:
    """Return the last line: how many ended how, and the wall time [s]."""
    counts = {
        verdict: sum(result.verdict is verdict for result in results)
        for verdict in Verdict
    }
    parts = [f"{n} {verdict.value}" for verdict, n in counts.items() if n]
    return f"{', '.join(parts) or 'nothing ran'} in {wall:.0f} s of wall time"


def page(
    results: Sequence[ScenarioResult], what: Mapping[str, str], wall: float
) -> str:
    """Return docs/lab.md.

    Args:
        results: of a full run.
        what: a sentence for each scenario.
        wall: time of the run on the host [s].
    """
    rows = [
        f"| {result.name} | {result.verdict.value} | {result.seconds:.1f} | "
        f"{_cell(result)} |\n"
        for result in results
    ]
    sentences = [f"- **{name}**: {sentence}\n" for name, sentence in what.items()]
    end = ["\n", *sentences, f"\n{summary(results, wall).capitalize()}.\n"]
    return "".join([_TITLE, _HEAD, *rows, *end])


def _cell(result: ScenarioResult) -> str:
    words = figure_words(result.figures)
    reason = result.reason.strip().splitlines()[-1:]
    return " ".join([*reason, words]).strip().replace("|", "\\|")
