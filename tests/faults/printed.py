"""Reactions, measured motion and hazards: `python -m tests.attacks hazards`."""

from tests.faults import choice, hazards
from tests.faults.bounds import BOUND_PHASES, PrintedBound, read_bounds
from tests.faults.expected import TABLE, Cell
from tests.faults.moving import MOVING_CELLS
from tests.faults.phases import MOVING, PHASES
from tests.faults.truth import Promise, promise_of

TRUTH = """
## True motion of the arm

Taken from the simulated arm, not from the driver's estimate: from the fault
to half a second after the command. `speed` is the largest joint speed as a share of the
joint's limit in rig.toml, with the joint; `travel` the travel of the sole within 0.5 s;
`drive` the force of the motors, beyond gravity compensation, on the person who
holds the sole; `hand` the force between arm and hand; `sole` its largest speed within
0.5 s. `idle` is when the arm went idle, `rest` when the sole came to rest for 0.1 s
(3 cm/s), both counted from the fault; - = not within 3 s. No cell may exceed speed 1,
travel 160 mm (100 mm if the fault stops the arm), drive 50 N and hand 80 N, unless
a note says so. Measured by `python -m tests.faults.bounds`.
"""


def text() -> str:
    """Return the three tables, in Markdown."""
    reactions = [choice.HEAD, *choice.choice_lines()]
    return (
        "\n".join([*reactions, TRUTH, *truth_lines(), *hazards.hazard_lines()]) + "\n"
    )


def truth_lines() -> list[str]:
    """Return the table of measured values, with the wider promises below it."""
    head = [f"{name}, {phase}" for phase in BOUND_PHASES for name in _MEASURED]
    rows = [f"| fault | {' | '.join(head)} |", "|---" * (len(head) + 1) + "|"]
    notes: list[str] = []
    for fault, row in read_bounds().items():
        cells: list[str] = []
        for phase in BOUND_PHASES:
            cell = _cell(fault, phase)
            cells += _words(row.get(phase), promise_of(fault, cell), notes)
        rows.append(f"| `{fault}` | {' | '.join(cells)} |")
    letters = (f"[{chr(96 + n)}] {why}." for n, why in enumerate(notes, 1))
    return [*rows, "", *letters]


_MEASURED = (
    "speed",
    "sole m/s",
    "travel mm",
    "drive N",
    "hand N",
    "idle ms",
    "rest ms",
)


def _cell(fault: str, phase: str) -> Cell:
    if phase == MOVING:
        return MOVING_CELLS[fault]
    return TABLE[fault][PHASES.index(phase)]


def _words(
    bound: PrintedBound | None, promise: Promise, notes: list[str]
) -> tuple[str, ...]:
    if bound is None:
        return ("-",) * len(_MEASURED)
    note = ""
    if promise.why:
        if promise.why not in notes:
            notes.append(promise.why)
        note = f" [{chr(97 + notes.index(promise.why))}]"
    speed = f"{bound.speed:.2f} (J{bound.joint}){note}" if bound.speed else "0"
    times = (bound.idle_ms, bound.rest_ms)
    return (
        speed,
        f"{bound.sole:.2f}",
        *(f"{x:.0f}" for x in (1e3 * bound.travel, bound.drive, bound.hand)),
        *("-" if ms is None else f"{ms:.0f}" for ms in times),
    )
