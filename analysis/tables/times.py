"""Times by ISO 8601 in seconds; pure."""

import re
from collections.abc import Sequence
from datetime import datetime
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

_ISO = re.compile(
    r"(?P<base>\d{4}-\d\d-\d\d[T ]\d\d:\d\d(?::\d\d)?)(?:[.,](?P<fraction>\d{1,9})\d*)?"
    r"\s*(?P<zone>Z|z|[+-]\d\d(?::?\d\d)?)?",
    re.ASCII,
)


class IsoTimes(NamedTuple):
    """ISO 8601 times.

    Attributes:
        seconds: since the first one, shape (n,); NaN for a missing one.
        wrong: index of the first cell that is none, or has a zone where the first has
            none or the other way round; None where all fit.
    """

    seconds: NDArray[np.float64]
    wrong: int | None


def is_iso(cell: str) -> bool:
    """Return whether a cell is a date with a time."""
    return _ISO.fullmatch(cell) is not None


def iso_times(cells: Sequence[str], missing: frozenset[str]) -> IsoTimes:
    """Return ISO 8601 times since the first; all have a zone, or none has.

    Args:
        cells: of the column.
        missing: cells that hold no value, in lower case.
    """
    seconds = np.full(len(cells), np.nan)
    origin: int | None = None
    has_zone: bool | None = None
    for k, cell in enumerate(cells):
        if cell.lower() in missing:
            continue
        match = _ISO.fullmatch(cell)
        if match is None or has_zone not in {None, match["zone"] is not None}:
            return IsoTimes(seconds, k)
        has_zone = match["zone"] is not None
        try:
            whole = _whole_seconds(match["base"], match["zone"] or "Z")
        except ValueError:
            return IsoTimes(seconds, k)
        now = whole * 1_000_000_000 + int((match["fraction"] or "").ljust(9, "0"))
        origin = now if origin is None else origin
        seconds[k] = (now - origin) * 1e-9
    return IsoTimes(seconds, None)


@lru_cache(maxsize=4096)
def _whole_seconds(base: str, zone: str) -> int:
    zone = "+00:00" if zone in "Zz" else zone
    return int(datetime.fromisoformat(base + zone).timestamp())
