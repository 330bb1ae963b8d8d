"""Times of a table in seconds from numbers, epochs and ISO 8601; pure."""

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
# 2001 to 2100 since 1970, by unit: a number of one is none of the others.
_FIRST, _LAST = 9.78e8, 4.11e9  # s
_LONGEST_STEP = 60.0  # s; a counter from another start has other steps
_EPOCHS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}


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


class SinceFirst(NamedTuple):
    """Times from an epoch.

    Attributes:
        t: since the first one, in the unit of the column, shape (n,).
        unit: of the column.
        note: what was found; "" where the times are no epoch.
    """

    t: NDArray[np.float64]
    unit: str
    note: str


def since_first(t: NDArray[np.float64], unit: str) -> SinceFirst:
    """Return times since the first where they count from 1970.

    Args:
        t: times, shape (n,); not finite where there is none.
        unit: of the column; "" where none is stated, then an epoch has that of its
            size.
    """
    finite = t[np.isfinite(t)]
    if not finite.size:
        return SinceFirst(t, unit, "")
    low, high = float(finite.min()), float(finite.max())
    step = float(np.median(np.abs(np.diff(finite)))) if finite.size > 1 else 0.0
    for name in (unit,) if unit else tuple(_EPOCHS):
        second = _EPOCHS.get(name, np.nan)
        is_since_1970 = low * second >= _FIRST and high * second <= _LAST
        if is_since_1970 and step * second <= _LONGEST_STEP:
            note = f"t counts {name} since 1970" + ("" if unit else " by its size")
            return SinceFirst(t - finite[0], name, note)
    return SinceFirst(t, unit, "")
