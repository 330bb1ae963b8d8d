"""Columns of a table: unit, meaning, and digits from what the instrument resolves."""

import csv
import io
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

Values = NDArray[np.generic]
Source = TypeVar("Source")
_FORMULA = ("=", "+", "-", "@", "\t", "\r")  # how a formula begins


@dataclass(frozen=True, slots=True)
class Quantity(Generic[Source]):
    """One or more columns of a table.

    Attributes:
        names: of the columns.
        unit: of all of them; "" for words.
        frame: where they are measured.
        meaning: what they are.
        values: takes them from a trial, shape (n,) or (n, columns).
        resolution: of the instrument, in the unit; 0 for whole numbers and words.
        kind: "number", "integer", "boolean" (0 or 1 in a CSV) or "string".
        more_digits: beyond those of the resolution, where more than noise depends on
            the value.
    """

    names: tuple[str, ...]
    unit: str
    frame: str
    meaning: str
    values: Callable[[Source], Values]
    resolution: float = 0.0
    kind: str = "integer"
    more_digits: int = 0

    @property
    def decimals(self) -> int:
        """Digits behind the point: one step is a tenth of the resolution or less."""
        return decimals_of(self.resolution) + self.more_digits


@dataclass(frozen=True, slots=True)
class TableColumn:
    """One column with its values as they are written.

    Attributes:
        name: without its unit.
        unit: "" for words.
        kind: as that of `Quantity`.
        meaning: what it is.
        decimals: digits behind the point; 0 for what is no measured number.
        values: of every row, shape (n,).
    """

    name: str
    unit: str
    kind: str
    meaning: str
    decimals: int
    values: Values

    @property
    def header(self) -> str:
        """The name with its unit."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name

    def cells(self) -> list[str]:
        """Return the values as text: NaN where there is none, 0 or 1 for booleans."""
        if self.kind == "boolean":
            return [str(int(value)) for value in self.values.tolist()]
        if self.kind != "number":
            return [str(value) for value in self.values.tolist()]
        texts = map(repr, self.values.tolist())
        return ["NaN" if text == "nan" else text for text in texts]


def decimals_of(resolution: float) -> int:
    """Return how many digits behind the point a tenth of `resolution` needs.

    Rounding errs by a twentieth of the resolution at most. It adds a hundredth at most
    to the variance of a value that is uniform in one step of the instrument: both
    variances are step^2 / 12.
    """
    return max(0, math.ceil(-math.log10(resolution / 10.0))) if resolution else 0


def columns_of(
    quantities: Sequence[Quantity[Source]], trial: Source, *, is_rounded: bool = True
) -> list[TableColumn]:
    """Return the columns of a trial, in the order of `quantities`.

    Args:
        quantities: what the columns hold.
        trial: where their values are taken from.
        is_rounded: numbers are those of a table; otherwise as recorded.
    """
    return [
        column
        for each in quantities
        for column in _columns(each, trial, is_rounded=is_rounded)
    ]


def _columns(
    quantity: Quantity[Source], trial: Source, *, is_rounded: bool
) -> list[TableColumn]:
    values = np.asarray(quantity.values(trial))
    table = values[:, None] if values.ndim == 1 else values
    decimals = quantity.decimals
    if quantity.kind == "number" and is_rounded:
        table = np.round(table.astype(np.float64), decimals) + 0.0  # no -0.0
    shared = (quantity.unit, quantity.kind, quantity.meaning, decimals)
    return [
        TableColumn(name, *shared, table[:, k]) for k, name in enumerate(quantity.names)
    ]


def csv_of(columns: Sequence[TableColumn]) -> str:
    """Return a table as CSV, units in the header."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([column.header for column in columns])
    writer.writerows(zip(*(column.cells() for column in columns), strict=True))
    return text.getvalue()


def csv_of_rows(rows: Sequence[Sequence[str]]) -> str:
    """Return rows of text as CSV that no spreadsheet takes for formulas."""
    text = io.StringIO()
    plain = [[plain_cell(cell) for cell in row] for row in rows]
    csv.writer(text, lineterminator="\n").writerows(plain)
    return text.getvalue()


def plain_cell(cell: str) -> str:
    """Return a text that no spreadsheet takes for a formula; numbers stay."""
    try:
        float(cell)
    except ValueError:
        return "'" + cell if cell.startswith(_FORMULA) else cell
    return cell
