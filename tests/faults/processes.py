"""The expected outcome of faults of processes, signals and the disk, as data."""

from dataclasses import replace

from tests.faults.expected import Cell, End
from tests.faults.phases import PHASES

_STOPPED = Cell(End.STOPPED)
_LOST = Cell(End.ENDED, " process ended: killed by SIGKILL.")
_GONE = Cell(End.KILLED)
_NO_ARM = replace(_GONE, why="the arm has not been requested yet")
_BEFORE = Cell(End.INTERRUPTED, "Interrupted.", why="there is no session yet")


_LEFT_OUT = Cell(
    End.UNBRACKETED,
    "No tare at the end",
    why="all trials are kept; only a tare is lost",
)


def _row(cell: Cell, preflight: Cell, end: Cell | None = None) -> tuple[Cell, ...]:
    others = {"preflight": preflight, "end": end or cell}
    return tuple(others.get(phase, cell) for phase in PHASES)


_EARLY = replace(_LOST, end=End.LOST_EARLY)
TABLE: dict[str, tuple[Cell, ...]] = {
    "console killed": _row(_GONE, _NO_ARM),
    "recorder killed": _row(_LOST, _EARLY, _LEFT_OUT),
    "sensor reader killed": _row(_LOST, _EARLY, _LEFT_OUT),
    "SIGINT": _row(_STOPPED, _BEFORE, _LEFT_OUT),
    "SIGINT twice": _row(_STOPPED, _BEFORE, _LEFT_OUT),
    "SIGTERM": _row(_STOPPED, _BEFORE, _LEFT_OUT),
    "SIGHUP": _row(_STOPPED, _BEFORE, _LEFT_OUT),
    "terminal closed": _row(_STOPPED, _BEFORE, replace(_LEFT_OUT, text="")),
    "fsync of 200 ms": _row(Cell(End.COMPLETE), Cell(End.COMPLETE)),
}
