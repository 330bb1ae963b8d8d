"""Rows of an attack as parameters of a test, marked with the command that runs them."""

from collections.abc import Iterable

import pytest

from tests.attacks.attack import Attack, RunBy

_MARKS = {
    RunBy.TEST: [],
    RunBy.CI: [pytest.mark.slow],
    RunBy.NIGHTLY: [pytest.mark.long],
}


def parameters(rows: Iterable[Attack]) -> list:
    """A parameter `row` for each row."""
    return [pytest.param(row, id=str(row), marks=_marks_of(row)) for row in rows]


def _marks_of(row: Attack) -> list[pytest.MarkDecorator]:
    timeout = pytest.mark.timeout(row.seconds)
    if not row.on_wall_clock:
        return [*_MARKS[row.run_by], timeout]
    long = [pytest.mark.long] if row.run_by is RunBy.NIGHTLY else []
    return [pytest.mark.wall_clock, *long, timeout]
