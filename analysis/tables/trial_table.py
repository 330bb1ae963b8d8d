"""Rows of one table before they become trials."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class TrialTable:
    """The rows of a table, in its own units.

    Attributes:
        rows: t, v_t, F_n and F_t, shape (n, 4); NaN for a missing value.
        units: unit by column, further columns included, where the table states one.
        is_prepared: the rows are samples kept by an earlier preparation.
        is_simulated: what the column `simulated` states; None without one.
        lines: line of the file of every row, shape (n,); None where it has no lines.
        header: line of the file with the names; None where it has none.
        is_in_seconds: times are seconds by the format of the file.
        further: further columns by name, each of shape (n,); NaN for a missing value.
        groups: words of every row by kind, "trial" or "terrain", that divide the table.
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
        """The line of a row in its file, for messages."""
        if self.lines is None:
            return f"row {row + 1}"
        return f"line {self.lines[row]}"
