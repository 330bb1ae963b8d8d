"""Print the fault matrix and the hazards, in Markdown: `python -m tests.faults`."""

from tests.faults import choice, hazards
from tests.faults.bounds import BOUND_PHASES, COLUMNS, PrintedBound, read_bounds
from tests.faults.expected import TABLE, Cell, End
from tests.faults.moving import MOVING_CELLS
from tests.faults.phases import MOVING, PHASES
from tests.faults.processes import TABLE as PROCESSES
from tests.faults.truth import Promise, promise_of

HEAD = """\
# Faults in every phase of a session

The result of each fault that `--fault` can raise, and of signals and killed processes,
in each phase of a session; and, in the last column, while the arm moves by itself from
pose to pose of a calibration.
"""
TRUTH = """
## True motion of the arm

Taken from the simulated arm itself, not from what the driver believes: from the fault
to half a second after the command. `speed` is the largest joint speed as a share of the
joint's limit in rig.toml, with the joint; `travel` how far the sole gets within 0.5 s;
`drive` the force that the motors, beyond the arm's weight, put on the person who
holds the sole; `hand` the force between arm and hand; `sole` its largest speed within
0.5 s. `idle` is when the arm went idle, `rest` when the sole began to stand for 0.1 s
(3 cm/s), both counted from the fault; - = not within 3 s. No cell may exceed speed 1,
travel 160 mm (100 mm where the fault stops the arm), drive 50 N and hand 80 N, but
where a note says so. Measured by `python -m tests.faults.bounds`.
"""
_NOT_REHEARSED = Cell(
    End.ABSENT, why="rehearsed in sessions; for ctrl-c see tests of the calibrations"
)


def lines() -> list[str]:
    """Return the table, and below it why some cells are as they are."""
    notes: list[str] = []

    def word(cell: Cell) -> str:
        if not cell.why:
            return cell.end.value
        if cell.why not in notes:
            notes.append(cell.why)
        return f"{cell.end.value} [{notes.index(cell.why) + 1}]"

    rows = [f"| fault | {' | '.join(COLUMNS)} |", "|---" * (len(COLUMNS) + 1) + "|"]
    every = _rows()
    for fault, row in every.items():
        rows.append(f"| `{fault}` | {' | '.join(word(cell) for cell in row)} |")
    rows += ["", *(f"[{n}] {why}." for n, why in enumerate(notes, 1))]
    cells = [c for row in every.values() for c in row]
    absent = sum(cell.end is End.ABSENT for cell in cells)
    return [*rows, "", f"{len(cells) - absent} cells, {absent} cannot exist."]


def truth_lines() -> list[str]:
    """Return the table of what was measured, and below it the wider promises."""
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


def _rows() -> dict[str, tuple[Cell, ...]]:
    arm = {fault: (*row, MOVING_CELLS[fault]) for fault, row in TABLE.items()}
    others = {fault: (*row, _NOT_REHEARSED) for fault, row in PROCESSES.items()}
    return {**arm, **others}


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


def text() -> str:
    """Return all tables."""
    parts = [HEAD, *lines(), choice.HEAD, *choice.choice_lines(), TRUTH]
    return "\n".join([*parts, *truth_lines(), *hazards.hazard_lines()]) + "\n"


if __name__ == "__main__":
    print(text(), end="")  # noqa: T201
