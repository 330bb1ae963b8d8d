"""Inputs from other programs and people, and their expected outcomes."""

import resource
import warnings
from pathlib import Path

from tests.attacks.attack import Attack
from tests.borders.calls import CALLS
from tests.borders.formats import FORMATS
from tests.borders.layouts import LAYOUTS
from tests.borders.numbers import NUMBERS
from tests.borders.row import Border
from tests.borders.simulated import SIMULATED

# Each subject is a module with its rows.
SUBJECTS: dict[str, tuple[Border, ...]] = {
    "Text tables: layout": LAYOUTS,
    "Text tables: numbers, units and times": NUMBERS,
    "Other formats": FORMATS,
    "Simulated and recorded": SIMULATED,
    "Python calls and file names": CALLS,
}
_MAX_KB = 500_000  # limit of the growth of peak memory by one row


def border_attacks() -> list[Attack]:
    """Every row of every subject."""
    return [_attack(subject, row) for subject, rows in SUBJECTS.items() for row in rows]


def _attack(subject: str, row: Border) -> Attack:
    def check(folder: Path) -> None:
        before_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            answer = row.act(folder)
        after_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        assert after_kb - before_kb < _MAX_KB
        assert answer.outcome is row.outcome, answer.words
        assert row.says in answer.words

    says = f": {row.says}" if row.says else ""
    return Attack(row.given, subject, f"{row.outcome.value}{says}", check)
