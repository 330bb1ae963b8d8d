"""Cells as numbers under one decimal mark of the whole file; pure.

Points and commas in one file are never guessed apart: one of them may group thousands,
and then a number is read a thousand times too small.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

MISSING = frozenset({"", "nan", "na", "n/a", "#n/a", "null", "none", "-", "--"})
MARKS = (".", ",")
_INFINITE = {"inf": np.inf, "infinity": np.inf}
_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_GROUPED = re.compile(
    r"[+-]?[1-9][0-9]{0,2}(?P<mark>[.,])[0-9]{3}(?:(?P=mark)[0-9]{3})*"
)
_OTHER_GROUPS = " '\u2019\u202f"


class Marks(NamedTuple):
    """Points and commas in the numbers of a file.

    Attributes:
        point: index of the first cell with a point; None without.
        comma: index of the first cell with a comma; None without.
        is_grouped: every cell with a mark may as well be thousands in groups.
    """

    point: int | None
    comma: int | None
    is_grouped: bool


def marks_in(cells: Iterable[str]) -> Marks:
    """Return which marks stand in the cells of numbers, in the order of the file."""
    first: dict[str, int] = {}
    is_grouped = True
    for k, cell in enumerate(cells):
        for mark in MARKS:
            if mark in cell:
                first.setdefault(mark, k)
                is_grouped = is_grouped and _GROUPED.fullmatch(cell) is not None
    return Marks(first.get("."), first.get(","), bool(first) and is_grouped)


@dataclass(frozen=True, slots=True)
class NumberForm:
    """How numbers are written in a file.

    Attributes:
        decimal: "." or ",".
        has_groups: thousands may stand in groups, because the user named the decimal
            mark.
    """

    decimal: str = "."
    has_groups: bool = False

    def number(self, cell: str) -> float | None:
        """Return a number, NaN for a missing one, None for what is none."""
        text = cell if self.decimal == "." else self._with_point(cell)
        if text is not None and _NUMBER.fullmatch(text):
            return float(text)
        word = cell.lower()
        if word in MISSING:
            return np.nan
        sign = -1.0 if word.startswith("-") else 1.0
        if (infinite := _INFINITE.get(word.lstrip("+-"))) is not None:
            return sign * infinite
        return self._ungrouped(cell) if self.has_groups else None

    def numbers(
        self, cells: Iterable[str], count: int
    ) -> tuple[NDArray[np.float64], int | None]:
        """Return the numbers of `count` cells, and which is the first that is none."""
        values = np.empty(count)
        for k, cell in enumerate(cells):
            value = self.number(cell)
            if value is None:
                return values, k
            values[k] = value
        return values, None

    def _with_point(self, cell: str) -> str | None:
        """Return a number with a decimal comma as one with a point."""
        return None if "." in cell else cell.replace(",", ".", 1)

    def _ungrouped(self, cell: str) -> float | None:
        """Return a number whose thousands are grouped by one mark throughout."""
        whole, mark, rest = cell.partition(self.decimal)
        if not re.fullmatch(r"[0-9]*", rest):
            return None
        other = "," if self.decimal == "." else "."
        groups = f"[{other}{_OTHER_GROUPS}]"
        form = rf"([+-]?[0-9]{{1,3}})(?:({groups})[0-9]{{3}})(?:\2[0-9]{{3}})*"
        if not re.fullmatch(form, whole):
            return None
        return float(re.sub(groups, "", whole) + ("." if mark else "") + rest)
