"""Parsing of ISO 8601 times; pure."""

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
    """Parsed ISO 8601 times.

    Attributes:
        seconds: time since the first one [s], shape (n,); NaN for a missing one.
        wrong: index of the first invalid cell, or of the first one that differs in
            having a time zone; None if all are valid.
    """

    seconds: NDArray[np.float64]
    wrong: int | None


def is_iso(cell: str) -> bool:
    """Return whether a cell is a date with a time."""
    return _ISO.fullmatch(cell) is not None


def iso_times(cells: Sequence[str], missing: frozenset[str]) -> IsoTimes:
    """Parse ISO 8601 times relative to the first; all or none must have a zone.

    Args:
        cells: cells of the column.
        missing: cell contents that mean no value, in lower case.
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
