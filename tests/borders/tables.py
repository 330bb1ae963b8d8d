"""Tables for the rows of borders, and how they are passed to the program."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.errors import SettingsError
from analysis.data.plausibility import doubts_of
from analysis.data.prepare import PrepareOptions, prepare_trial
from analysis.data.series import TractionSeries
from analysis.tables.loading import load_tables
from tests.borders.row import Answer, Border, Outcome

NAMES = ("t", "v_t", "F_n", "F_t")
COUNT = 60
Cells = Sequence[Sequence[str]]
# As written by other programs: different numbers of decimals, 500 rows per second.
ROWS = [
    [
        f"{0.002 * k:.4f}",
        f"{0.0800 + 0.001 * (k % 7):.5f}",
        f"{22.051 + 0.113 * (k % 5):.3f}",
        f"{3.0984 + 0.21 * (k % 3):.4f}",
    ]
    for k in range(COUNT)
]
VALUES = np.array(ROWS, dtype=np.float64)


def text(
    rows: Cells = ROWS, delimiter: str = ",", names: Sequence[str] = NAMES, mark="."
) -> str:
    """A table as text."""
    lines = [delimiter.join(cell.replace(".", mark) for cell in row) for row in rows]
    return "\n".join([delimiter.join(names), *lines]) + "\n"


def with_column(column: int, change: Callable[[int, str], str]) -> list[list[str]]:
    """The rows with one column changed."""
    return [
        [*row[:column], change(k, row[column]), *row[column + 1 :]]
        for k, row in enumerate(ROWS)
    ]


def with_cell(row: int, column: int, cell: str) -> list[list[str]]:
    """The rows with one cell changed."""
    return with_column(column, lambda k, old: cell if k == row else old)


def values(**columns: np.ndarray) -> np.ndarray:
    """The numbers with some columns replaced."""
    changed = VALUES.copy()
    for name, column in columns.items():
        changed[:, NAMES.index(name)] = column
    return changed


def without(*rows: int) -> np.ndarray:
    """The numbers without some rows."""
    return np.delete(VALUES, rows, axis=0)


def judged(
    load: Callable[[], Any], expected: np.ndarray | None, doubts: bool
) -> Answer:
    """Answer of the program that reads one trial."""
    try:
        ((series,),) = load().values()
    except SettingsError as error:
        return Answer(Outcome.REFUSED, str(error))
    read = np.column_stack([series.t, series.v_t, series.F_n, series.F_t])
    wanted = VALUES if expected is None else expected
    if read.shape != wanted.shape or not np.allclose(read, wanted, 1e-12, 1e-12):
        return Answer(Outcome.WRONG, f"{read[:2]} instead of {wanted[:2]}")
    words = [*series.notes, *(_doubts(series) if doubts else ())]
    return Answer(Outcome.FLAGGED if words else Outcome.READ, "; ".join(words))


def _doubts(series: TractionSeries) -> list[str]:
    trial = prepare_trial(series, PrepareOptions())
    return [doubt.text for doubt in doubts_of(trial)]


def table(
    given: str,
    content: str | bytes,
    outcome: Outcome = Outcome.READ,
    says: str = "",
    expected: np.ndarray | None = None,
    file: str = "trial.csv",
    doubts: bool = False,
    **options: Any,
) -> Border:
    """A row of a file with this content."""

    def act(folder: Path) -> Answer:
        path = folder / file
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return judged(lambda: load_tables([path], **options), expected, doubts)

    return Border(given, outcome, says, act)


def refused(given: str, content: str | bytes, says: str, **options: Any) -> Border:
    """A row of a file that is refused."""
    return table(given, content, Outcome.REFUSED, says, **options)


def flagged(given: str, content: str | bytes, says: str, **options: Any) -> Border:
    """A row of a file that is read with a warning."""
    return table(given, content, Outcome.FLAGGED, says, **options)
