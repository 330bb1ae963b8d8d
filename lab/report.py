"""The table of verdicts: on the terminal, and as docs/lab.md."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from lab.results import ScenarioResult, Verdict

_TITLE = "# Laboratory: the program with the real kernel's drivers\n"
_HEAD = """
Made by `make lab-page` (`python -m lab --write docs/lab.md`). Each scenario runs the
unmodified program in an emulated machine: Debian's kernel, its `kvaser_pci` (SJA1000)
and `ftdi_sio` drivers, `can0` and `/dev/ttyUSB0` as on the rig; the simulated arm is on
`can1`, the simulated sensor at the far end of the serial adapter. All times are guest
time: the machine's clock follows the instructions it executes, so a busy host changes
none of them. `processor s` is what a scenario took of the host. Arm and sensor are
simulated by a process of the host; a relay in the machine carries their frames and
bytes. The machine stands still while that process computes, so no time passes in it.

| scenario | verdict | guest s | processor s | figures |
|---|---|---|---|---|
"""
_FIGURES = """
## Figures

`exchange`: from the request to the seventh position, median and 99th percentile, with
how many of 100 exchanges were incomplete. `cycles`, `missed`, `gap`: cycles of the kept
trials, those whose time passed without one, the longest time between two. A trial is
counted only where `traction verify` accepts it. Where a fault of docs/faults.md is
raised, the exit code is the one that this page promises for the phase. `answer`: from a
question to a puck to its answer, median. `early`: an arm active that nobody has asked
to be, until it is idle again. `stop`: from the mode E-stop to the first cycle without
any reply. `lift-off`: torque that a ramp of C9 had reached where it lifted the joint
off its stop. `silence`: from the last question of C8 to a module that brakes. `sole`:
how far it went in a step of C8 to C11. `repeated`: the emulated
kernel had panicked in the scenario, which was then run once more.
"""
_NOT_SHOWN = """
## Not covered

- Bit time, arbitration, missing acknowledgement, error frames and bus-off: the emulated
  bus has none of them. Their handling is tested against `slcan` and simulated buses.
- How late a real host wakes: guest time does not pass while the host does other things.
- The time that an adapter on USB needs: both cards are PCI cards without a delay.
- Hardware time stamps: `kvaser_pci` has software time stamps only.
- Replies one by one in a session: what its simulated arm says within 0.55 ms leaves
  together, and the arm computes in no time at all. In "home arm", "link down at start",
  "second host", "full queue" and for C2 and C4 of "commission a wrong arm"
  `traction fake` serves the arm inside the machine: replies come one by one, after the
  time that it needs.
- The start of a process: programs begin forked, their libraries loaded, but for the
  `check` of "home arm", which is executed. The preflight tests the loop for 0.5 s
  (`[loop] test_time`), there for 2 s.
"""
_CONFIDENT = 3.0  # events that 95 % of all runs would show, where none was seen


@dataclass(frozen=True, slots=True)
class Conditions:
    """What a run was made with.

    Attributes:
        kernel: the guest's, by its release.
        emulator: QEMU's version.
        processor: the host's.
        machines: so many at once.
        wall: time of the run on the host [s].
    """

    kernel: str
    emulator: str
    processor: str
    machines: int
    wall: float


def figure_words(figures: Mapping[str, str]) -> str:
    """Return figures in one line."""
    return "; ".join(f"{name}: {value}" for name, value in figures.items())


def result_line(result: ScenarioResult) -> str:
    """Return a result as one line of the terminal's table."""
    words = result.reason or figure_words(result.figures)
    # A traceback says what it is in its last line.
    last = words.strip().splitlines()[-1:] or [""]
    seconds = f"{result.seconds:8.2f} s {result.processor:7.1f} s"
    return f"{result.verdict.value:<10} {result.name:<28} {seconds}  {last[0]}"


def summary(results: Sequence[ScenarioResult], wall: float) -> str:
    """Return the last line: how many ended how, and the wall time [s]."""
    counts = {
        verdict: sum(result.verdict is verdict for result in results)
        for verdict in Verdict
    }
    parts = [f"{n} {verdict.value}" for verdict, n in counts.items() if n]
    return f"{', '.join(parts) or 'nothing ran'} in {wall:.0f} s of wall time"


def cycle_words(results: Sequence[ScenarioResult]) -> str:
    """Return the cycles of all kept trials, and what their number lets one say."""
    rows = [result.figures for result in results if "cycles" in result.figures]
    cycles = sum(int(row["cycles"]) for row in rows)
    missed = sum(int(row["missed"]) for row in rows)
    if not cycles:
        return "No trial was kept."
    words = f"{missed} of {cycles} cycles of kept trials were missed"
    if missed:
        return f"{words}: {missed / cycles * 1e6:.0f} ppm."
    bound = _CONFIDENT / cycles * 1e6
    return f"{words}: below {bound:.0f} ppm with 95 % confidence."


def page(
    results: Sequence[ScenarioResult], what: Mapping[str, str], conditions: Conditions
) -> str:
    """Return docs/lab.md.

    Args:
        results: of a full run.
        what: a sentence for each scenario.
        conditions: what it was made with.
    """
    rows = [
        f"| {result.name} | {result.verdict.value} | {result.seconds:.1f} | "
        f"{result.processor:.0f} | {_cell(result)} |\n"
        for result in results
    ]
    sentences = [f"- **{name}**: {sentence}\n" for name, sentence in what.items()]
    taken = sum(result.processor for result in results)
    verdicts = summary(results, conditions.wall).capitalize()
    made = (
        f"\n{verdicts}, with {conditions.machines} machines at once and "
        f"{taken:.0f} s of processor time beside their starts. Kernel "
        f"{conditions.kernel}, {conditions.emulator}, {conditions.processor}.\n\n"
        f"{cycle_words(results)}\n"
    )
    ends = [made, _FIGURES, "\n", *sentences, _NOT_SHOWN]
    return "".join([_TITLE, _HEAD, *rows, *ends])


def _cell(result: ScenarioResult) -> str:
    words = figure_words(result.figures)
    reason = result.reason.strip().splitlines()[-1:]
    return " ".join([*reason, words]).strip().replace("|", "\\|")
