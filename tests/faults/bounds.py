"""Measured bounds of every fault: `python -m tests.faults.bounds [PART OF A NAME]`.

They apply to a trial with a person's push and to an autonomous move. They are
stored in bounds.json beside this module, so that tables are printed without a run; the
matrix checks its cells against them. A run takes about ten minutes.
"""

import json
import sys
import tempfile
from dataclasses import astuple, dataclass
from functools import lru_cache
from pathlib import Path

from tests.experiments.program import write_config
from tests.faults.expected import Cell, End, cells
from tests.faults.moving import MOVING_CELLS
from tests.faults.phases import MOVING, PHASES
from tests.faults.rehearse import run_with
from tests.faults.strikes import strike_of
from tests.faults.truth import Promise, TrueMotion

COLUMNS = (*PHASES, MOVING)
BOUND_PHASES = ("recording", MOVING)
PATH = Path(__file__).with_name("bounds.json")
# Rounding differs between machines; the motion before a fault may change slightly.
_SHARE, _SLACK = 1.25, (0.05, 0.005, 3.0, 10.0)


@dataclass(frozen=True, slots=True)
class PrintedBound:
    """The measured values of a cell, rounded up; fields as in `TrueMotion`."""

    speed: float
    joint: int
    travel: float
    drive: float
    hand: float
    sole: float
    idle_ms: float | None
    rest_ms: float | None

    def with_margin(self) -> Promise:
        """Return the bounds of a run on another machine."""
        values = (self.speed, self.travel, self.drive, self.hand)
        pairs = zip(values, _SLACK, strict=True)
        return Promise(*(_SHARE * value + slack for value, slack in pairs))


def cells_of_all() -> list[tuple[str, str, Cell]]:
    """Return (fault, phase, outcome) of every cell, autonomous moves included."""
    moving = [
        (fault, MOVING, cell)
        for fault, cell in MOVING_CELLS.items()
        if cell.end is not End.ABSENT
    ]
    return [*cells(), *moving]


@lru_cache
def read_bounds() -> dict[str, dict[str, PrintedBound]]:
    """Return the bounds by fault and phase."""
    rows = json.loads(PATH.read_text()) if PATH.exists() else {}
    return {
        fault: {phase: PrintedBound(*values) for phase, values in row.items()}
        for fault, row in rows.items()
    }


def _rounded(motion: TrueMotion) -> list[float | None]:
    """Return the values rounded up to two or three decimals."""
    return [
        _up(motion.speed, 0.01),
        motion.joint,
        _up(motion.travel, 0.001),
        _up(motion.drive, 0.1),
        _up(motion.hand, 0.1),
        _up(motion.sole, 0.01),
        None if motion.idle_ms is None else _up(motion.idle_ms, 1.0),
        None if motion.rest_ms is None else _up(motion.rest_ms, 1.0),
    ]


def _up(value: float, step: float) -> float:
    return round(-(-value // step) * step, 3)


def main(part: str) -> None:
    """Measure the cells whose name contains `part` and write the results."""
    rows = {
        f: {p: list(astuple(b)) for p, b in r.items()} for f, r in read_bounds().items()
    }
    with tempfile.TemporaryDirectory(prefix="bounds-") as scratch:
        config = write_config(Path(scratch))
        for number, (fault, phase, _) in enumerate(cells_of_all()):
            if phase not in BOUND_PHASES or part not in f"{fault}-{phase}":
                continue
            seen = run_with(
                strike_of(fault), phase, config, Path(scratch, f"d{number}")
            )
            motion = seen.truth.since(seen.scene.struck_ns, fault)
            rows.setdefault(fault, {})[phase] = _rounded(motion)
            print(fault, phase, *rows[fault][phase], flush=True)  # noqa: T201
            _write(rows)


def _write(rows: dict[str, dict[str, list[float | None]]]) -> None:
    """Write one line per cell, in the order of the table."""
    order = dict.fromkeys(fault for fault, _, _ in cells_of_all())
    known = {
        fault: {p: rows[fault][p] for p in BOUND_PHASES if p in rows[fault]}
        for fault in order
        if fault in rows
    }
    lines = [
        f"  {json.dumps(fault)}: {{\n"
        + ",\n".join(f"    {json.dumps(p)}: {json.dumps(v)}" for p, v in row.items())
        + "\n  }"
        for fault, row in known.items()
    ]
    PATH.write_text("{\n" + ",\n".join(lines) + "\n}\n")


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "")
