"""Plausibility checks of the rows of a table before any analysis; pure.

A time in another unit, a gap, a spike or a column that lacks most of its values is
refused or reported, with its line.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from acquisition.clock import RATE_HZ
from acquisition.errors import SettingsError
from acquisition.wording import counted
from analysis.data.series import Array
from analysis.tables.columns import COLUMNS
from analysis.tables.refusals import refusal
from analysis.tables.trial_table import TrialTable

MOST_MISSING = 0.2  # largest share of rows without a value
GAP = 1.0  # s between two rows
_STEPS = 10.0  # smallest gap as a multiple of the median step
_SLOWEST, _FASTEST = 0.2, 2e-5  # s between rows if the unit of t is not stated
_WORDS = {"d": "days"}
_USUAL = (5e-5, 0.2)  # s, plausible range between rows
_IMPOSSIBLE = 1e9  # m/s or N
_WILD = 20.0  # multiple of the 99.9 % quantile beyond which a value is an outlier
_FLOORS = (0.05, 1.0, 1.0)  # m/s, N, N; lower limits of that quantile
# Column, unit suggested by values above the limit, and the limit [m/s, N].
_UNUSUAL = (("v_t", "mm/s", 2.0), ("F_n", "mN", 500.0), ("F_t", "mN", 2500.0))
_FEWEST = 20  # rows below which outliers are not searched
_LOWEST_RATE = 90.0  # Hz below which smoothing over 22 ms has no effect
_OWN_RATE = 0.02  # relative difference from the rig's rate that is not reported


def check_clock(path: Path, rows: Array, is_stated: bool) -> None:
    """Refuse times that do not look like seconds, unless their unit is stated.

    Args:
        path: the file.
        rows: t, v_t, F_n, F_t in s, m/s and N as stated, shape (n, 4).
        is_stated: the unit of t is stated.

    Raises:
        SettingsError: the times look like another unit.
    """
    step = _step(rows)
    if is_stated or step is None or _FASTEST <= step <= _SLOWEST:
        return
    units = {"ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "d": 86_400.0}
    low, high = _USUAL
    likely = [name for name, unit in units.items() if low <= step * unit <= high]
    looks = (
        f"these look like {_WORDS.get(likely[0], likely[0])}"
        if likely
        else "no unit of t is stated"
    )
    raise refusal(
        path,
        f"column t: {step:.6g} s between two rows; {looks}",
        f"State it: --unit t={likely[0] if likely else 's'}"
        + ("; or --unit t=s if they are seconds." if likely else ""),
    )


def check_order(path: Path, table: TrialTable, rows: Array) -> None:
    """Refuse times that do not increase; repeated rows are allowed.

    Raises:
        SettingsError: time does not increase at a row.
    """
    kept = np.flatnonzero(np.isfinite(rows).all(axis=1))
    if kept.size < 2:
        return
    t = rows[kept, 0]
    is_same = (rows[kept[1:]] == rows[kept[:-1]]).all(axis=1)
    backward = np.flatnonzero((np.diff(t) <= 0.0) & ~is_same)
    if not backward.size:
        return
    row = int(backward[0]) + 1
    where = table.location(int(kept[row]))
    before, now = float(t[row - 1]), float(t[row])
    shared = int(np.count_nonzero((np.diff(t) == 0.0) & ~is_same))
    if now == before and shared > kept.size // 2:
        hint = (
            f"{shared} of {kept.size} rows have the time of the row before: give the "
            "times more digits, or leave t out and give --rate HZ."
        )
    elif backward.size > kept.size // 2:
        hint = "Sort the rows by time; or --negate t where it counts down."
    elif now <= t[0] + abs(before - t[0]) / 2.0:
        hint = (
            f"The times fall back to their start there: if this is another trial, "
            f"split the file at {where}."
        )
    else:
        hint = "Sort the rows by time, each time once."
    raise SettingsError(
        f"{path}, {where}, column t: time does not increase ({before:.9g} s, then "
        f"{now:.9g} s).",
        hint=hint,
    )


def check_size(path: Path, table: TrialTable, rows: Array) -> None:
    """Refuse values that no foot has and whose squares overflow.

    Raises:
        SettingsError: a finite value is beyond `_IMPOSSIBLE`.
    """
    beyond = np.isfinite(rows[:, 1:]) & (np.abs(rows[:, 1:]) > _IMPOSSIBLE)
    if not beyond.any():
        return
    row, k = np.argwhere(beyond)[0]
    raise SettingsError(
        f"{path}, {table.location(int(row))}, column {COLUMNS[k + 1]}: "
        f"{rows[row, k + 1]:.6g} is no measurement.",
        hint="A code for a missing value? Leave such cells empty.",
    )


def notes_of(path: Path, table: TrialTable, rows: Array) -> Iterator[str]:
    """Yield remarks on a table: missing values, units, outliers, gaps, rate.

    Raises:
        SettingsError: too many rows lack a value.
    """
    yield from _missing(path, table, rows)
    yield from _units(table, rows)
    yield from _outliers(table, rows)
    if not table.is_prepared:
        yield from _gaps(table, rows)
        yield from _rate(rows)


def _missing(path: Path, table: TrialTable, rows: Array) -> Iterator[str]:
    is_missing = np.isnan(rows)
    lacking = is_missing.any(axis=1)
    count = int(np.count_nonzero(lacking))
    if count > MOST_MISSING * len(rows):
        column = COLUMNS[int(is_missing.sum(axis=0).argmax())]
        first = table.location(int(lacking.argmax()))
        raise refusal(
            path,
            f"{count} of {len(rows)} rows lack a value, most of them in {column}; the "
            f"first is {first}",
            "Columns of different rates? Bring them to one rate, e.g. "
            f"pandas.read_csv('{path}').interpolate().",
        )
    if count:
        first = table.location(int(lacking.argmax()))
        yield f"{counted(count, 'row')} without a value dropped, the first is {first}"
    infinite = np.isinf(rows).any(axis=1)
    if infinite.any():
        first = table.location(int(infinite.argmax()))
        count = counted(int(np.count_nonzero(infinite)), "row")
        yield f"{count} with an infinite value dropped, the first is {first}"


def _units(table: TrialTable, rows: Array) -> Iterator[str]:
    """Report columns with values implausible in the assumed unit."""
    for k, (name, looks, most) in enumerate(_UNUSUAL, 1):
        size = np.abs(rows[np.isfinite(rows[:, k]), k])
        if name in table.units or not size.size:
            continue
        common = float(np.quantile(size, 0.9))
        if common > most:
            yield (
                f"{name} is {common:.3g} or more in a tenth of the rows; in {looks}? "
                f"--unit {name}={looks}"
            )


def _outliers(table: TrialTable, rows: Array) -> Iterator[str]:
    """Report values far beyond nearly all others: spikes, and missing-value codes."""
    if len(rows) < _FEWEST:
        return
    for k, floor in enumerate(_FLOORS, 1):
        size = np.abs(rows[:, k])
        size[~np.isfinite(size)] = 0.0
        same = size == size.max()
        others = float(size[~same].max(initial=0.0))
        count = int(np.count_nonzero(same))
        is_rare = 1 < count <= MOST_MISSING * size.size
        if is_rare and size.max() > _WILD * max(others, floor):
            first = int(same.argmax())
            yield (
                f"{COLUMNS[k]} is {rows[first, k]:.6g} in {counted(count, 'row')}, the "
                f"first is {table.location(first)}, elsewhere {others:.3g} at most: a "
                "code for a missing value? Leave the cells empty"
            )
            continue
        spared = max(3, -(-size.size // 1000))
        usual = float(np.partition(size, -spared - 1)[-spared - 1])
        outliers = np.flatnonzero(size > _WILD * max(usual, floor))
        if outliers.size:
            first = int(outliers[0])
            more = f" and in {outliers.size - 1} more rows" if outliers.size > 1 else ""
            yield (
                f"{COLUMNS[k]} is {rows[first, k]:.6g} in {table.location(first)}"
                f"{more}, elsewhere {usual:.3g} at most: a spike? Leave the cell empty"
            )


def _gaps(table: TrialTable, rows: Array) -> Iterator[str]:
    kept = np.flatnonzero(np.isfinite(rows).all(axis=1))
    if kept.size < 3:
        return
    steps = np.diff(rows[kept, 0])
    wide = np.flatnonzero(steps > max(GAP, _STEPS * float(np.median(steps))))
    if wide.size:
        first = int(wide[0])
        more = f", and {wide.size - 1} more gaps" if wide.size > 1 else ""
        yield (
            f"gap of {steps[first]:.4g} s before {table.location(int(kept[first + 1]))}"
            f"{more}; nothing is averaged or integrated across it"
        )


def _rate(rows: Array) -> Iterator[str]:
    step = _step(rows)
    if step is None or step <= 0.0:
        return
    rate = 1.0 / step
    if rate < _LOWEST_RATE:
        yield f"{rate:.3g} Hz: nothing is smoothed, and slips are not seen"
    elif abs(rate / RATE_HZ - 1.0) > _OWN_RATE:
        yield f"{rate:.4g} Hz, not {RATE_HZ}: averaged over 22 ms, kept every 10 ms"


def _step(rows: Array) -> float | None:
    """Return the median time step [s]; None with fewer than three rows."""
    t = rows[np.isfinite(rows[:, 0]), 0]
    return float(np.median(np.abs(np.diff(t)))) if t.size > 2 else None
