"""Columns of a table: unit, meaning, and digits from the instrument's resolution."""

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
_FORMULA = ("=", "+", "-", "@", "\t", "\r")  # first characters of a formula


@dataclass(frozen=True, slots=True)
class Quantity(Generic[Source]):
    """One or more columns of a table.

    Attributes:
        names: names of the columns.
        unit: unit of all columns; "" for words.
        frame: frame of the measurement.
        meaning: description.
        values: extracts the values from a trial, shape (n,) or (n, columns).
        resolution: resolution of the instrument, in the unit; 0 for integers and words.
        kind: "number", "integer", "boolean" (0 or 1 in a CSV) or "string".
        more_digits: digits beyond those of the resolution.
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
        """Number of decimals: one step is a tenth of the resolution or less."""
        return decimals_of(self.resolution) + self.more_digits


@dataclass(frozen=True, slots=True)
class TableColumn:
    """One column with its values as written.

    Attributes:
        name: name without unit.
        unit: "" for words.
        kind: as in `Quantity`.
        meaning: description.
        decimals: number of decimals; 0 unless a measured number.
        values: values of all rows, shape (n,).
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
        """Return the values as text: NaN for missing ones, 0 or 1 for booleans."""
        if self.kind == "boolean":
            return [str(int(value)) for value in self.values.tolist()]
        if self.kind != "number":
            return [str(value) for value in self.values.tolist()]
        texts = map(repr, self.values.tolist())
        return ["NaN" if text == "nan" else text for text in texts]


def decimals_of(resolution: float) -> int:
    """Number of decimals that a tenth of `resolution` needs.

    The rounding error is at most a twentieth of the resolution. It adds at most a
    hundredth to the variance of a value that is uniform in one step of the instrument:
    both variances are step^2 / 12.
    """
    return max(0, math.ceil(-math.log10(resolution / 10.0))) if resolution else 0


def columns_of(
    quantities: Sequence[Quantity[Source]], trial: Source, *, is_rounded: bool = True
) -> list[TableColumn]:
    """Return the columns of a trial, in the order of `quantities`.

    Args:
        quantities: the quantities.
        trial: source of the values.
        is_rounded: round numbers as in a table; otherwise as recorded.
    """
    return [
        column
        for quantity in quantities
        for column in _columns(quantity, trial, is_rounded=is_rounded)
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
    """Return rows of text as CSV, escaped against formulas in spreadsheets."""
    text = io.StringIO()
    plain = [[plain_cell(cell) for cell in row] for row in rows]
    csv.writer(text, lineterminator="\n").writerows(plain)
    return text.getvalue()


def plain_cell(cell: str) -> str:
    """Escape a text that a spreadsheet would take for a formula."""
    try:
        float(cell)
    except ValueError:
        return "'" + cell if cell.startswith(_FORMULA) else cell
    return cell
