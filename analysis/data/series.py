"""Velocity and forces of one trial over time: the input of the analysis."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from acquisition.errors import SettingsError
from analysis.data.terrain_kinds import Value

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

MINIMUM_SAMPLES = 3
LONGEST_NAME = 60
_COLUMNS = ("t", "v_t", "F_n", "F_t")


@dataclass(frozen=True, slots=True)
class TractionSeries:
    """One trial at the recorded rate, neither smoothed nor windowed.

    Rows with a value that is not finite, and rows that repeat the previous one in all
    columns, are dropped at construction and counted; the arrays are then read-only
    copies, all of shape (n,).

    Attributes:
        terrain: name of the terrain, e.g. "S10".
        name: name of the trial in messages: a file, or a key in a file.
        t: time [s], strictly increasing.
        v_t: velocity of the sole along the slip direction [m/s], > 0 in slip.
        F_n: normal force [N], > 0 in compression.
        F_t: traction force [N], > 0 in slip.
        stones: size of the stones as recorded or given: "small", "big" or "none";
            empty where it is not known.
        incline_deg: incline of the plane along the push [degrees]; None if unknown.
        factors: further properties of the terrain and the foot by name; None = does
            not apply.
        units: units of the numeric factors by name.
        stamped_lag: age of the forces relative to the velocity by their own time
            stamps [s]; 0 without time stamps.
        is_prepared: the rows are samples kept by an earlier preparation: smoothed,
            thinned and windowed.
        is_simulated: the devices were simulated.
        is_foreign: the trial is a table from another program.
        notes: decisions made when a table was read, for the reader.
        further: other inputs of every row by name, each of shape (n,), e.g. an angle.
        dropped_rows: number of rows that were not finite.
        repeated_rows: number of duplicate rows.

    Raises:
        SettingsError: the arrays differ in length, too few rows are finite, time does
            not increase, or the terrain has no usable name.
    """

    terrain: str
    name: str
    t: Array
    v_t: Array
    F_n: Array
    F_t: Array
    stones: str = ""
    incline_deg: float | None = None
    factors: Mapping[str, Value] = field(default_factory=dict[str, Value])
    units: Mapping[str, str] = field(default_factory=dict[str, str])
    stamped_lag: float = 0.0
    is_prepared: bool = False
    is_simulated: bool = False
    is_foreign: bool = False
    notes: tuple[str, ...] = ()
    further: Mapping[str, Array] = field(default_factory=dict[str, Array])
    dropped_rows: int = field(init=False)
    repeated_rows: int = field(init=False)

    def __post_init__(self) -> None:
        _check_name(self.terrain, self.name)
        columns = [np.asarray(getattr(self, key), dtype=np.float64) for key in _COLUMNS]
        columns += [np.asarray(x, dtype=np.float64) for x in self.further.values()]
        _check_shapes(columns, (*_COLUMNS, *self.further), self.name)
        is_finite = _all_true([np.isfinite(column) for column in columns])
        rows = int(np.count_nonzero(is_finite))
        if rows < is_finite.size:
            columns = [column[is_finite] for column in columns]
        is_repeated = _all_true([column[1:] == column[:-1] for column in columns])
        repeated = int(np.count_nonzero(is_repeated))
        if rows - repeated < MINIMUM_SAMPLES:
            raise SettingsError(
                f"{self.name}: {rows - repeated} finite rows of "
                f"{is_finite.size}, at least {MINIMUM_SAMPLES} are needed.",
                hint="Check that the file is complete.",
            )
        is_new = np.concatenate([[True], ~is_repeated])
        kept = [c[is_new] if repeated else np.array(c, order="C") for c in columns]
        for column in kept:
            column.setflags(write=False)
        for key, column in zip(_COLUMNS, kept[: len(_COLUMNS)], strict=True):
            object.__setattr__(self, key, column)
        further = dict(zip(self.further, kept[len(_COLUMNS) :], strict=True))
        object.__setattr__(self, "further", further)
        object.__setattr__(self, "dropped_rows", is_finite.size - rows)
        object.__setattr__(self, "repeated_rows", repeated)
        _check_time(self.t, self.name)

    @property
    def rate(self) -> float:
        """Sampling rate [Hz], from the median step of time; may be infinite."""
        with np.errstate(over="ignore"):
            return float(1.0 / np.median(np.diff(self.t)))

    def with_lag_removed(self, lag: float) -> "TractionSeries":
        """Compensate a lag of the forces: take them from `lag` [s] later.

        Rows for which no such forces were recorded are dropped.

        Raises:
            SettingsError: fewer than three rows are left, or the rows were prepared,
                so that the samples between them are gone.
        """
        if self.is_prepared:
            raise SettingsError(
                f"{self.name}: forces of kept samples cannot be taken later.",
                hint="Give the table of the whole trial.",
            )
        at = self.t + lag
        inside = (at >= self.t[0]) & (at <= self.t[-1])
        F_n, F_t = (np.interp(at, self.t, F)[inside] for F in (self.F_n, self.F_t))
        return replace(
            self,
            t=self.t[inside],
            v_t=self.v_t[inside],
            F_n=F_n,
            F_t=F_t,
            stamped_lag=self.stamped_lag - lag,
            further={name: x[inside] for name, x in self.further.items()},
        )


def _all_true(masks: list[NDArray[np.bool_]]) -> NDArray[np.bool_]:
    """Combine masks of all columns by logical and, shape (n,)."""
    return np.logical_and.reduce(masks)


def _check_name(terrain: str, name: str) -> None:
    if not 0 < len(terrain) <= LONGEST_NAME or not terrain.isprintable():
        raise SettingsError(
            f"{name}: {terrain[:LONGEST_NAME]!r} is not a name for a terrain "
            f"(1 to {LONGEST_NAME} printable characters).",
            hint="Give a short name such as S0.",
        )


def _check_shapes(columns: list[Array], keys: Sequence[str], name: str) -> None:
    shapes = [column.shape for column in columns]
    if any(len(shape) != 1 for shape in shapes) or len(set(shapes)) != 1:
        listed = ", ".join(f"{k} {s}" for k, s in zip(keys, shapes, strict=True))
        raise SettingsError(
            f"{name}: the columns differ in shape ({listed}).",
            hint="All must be one-dimensional and equally long.",
        )


def _check_time(t: Array, name: str) -> None:
    backward = np.flatnonzero(np.diff(t) <= 0)
    if backward.size:
        row = int(backward[0]) + 1
        raise SettingsError(
            f"{name}: time does not increase at row {row} "
            f"({t[row - 1]:.6g} s, then {t[row]:.6g} s).",
            hint="Rows must be in time order, each time once.",
        )
