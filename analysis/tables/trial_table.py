"""Rows of one table before conversion to trials."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class TrialTable:
    """Rows of a table in its own units.

    Attributes:
        rows: t, v_t, F_n and F_t, shape (n, 4); NaN for a missing value.
        units: unit by column, further columns included, if the table states one.
        is_prepared: the rows are samples kept by an earlier preparation.
        is_simulated: value of the column `simulated`; None without one.
        lines: line in the file of every row, shape (n,); None if not a text file.
        header: line in the file with the names; None if not a text file.
        is_in_seconds: times are seconds by the format of the file.
        further: further columns by name, each of shape (n,); NaN for a missing value.
        groups: text of every row that divides the table, by "trial" or "terrain".
    """

    rows: Array
    units: Mapping[str, str]
    is_prepared: bool = False
    is_simulated: bool | None = None
    lines: NDArray[np.intp] | None = None
    header: int | None = None
    is_in_seconds: bool = False
    further: Mapping[str, Array] = field(default_factory=dict[str, Array])
    groups: Mapping[str, Sequence[str]] = field(
        default_factory=dict[str, Sequence[str]]
    )

    def location(self, row: int) -> str:
        """Return the location of a row in its file for messages."""
        if self.lines is None:
            return f"row {row + 1}"
        return f"line {self.lines[row]}"
