"""Preparation of a recorded trial for model fitting.

Steps: centred moving average, every fifth sample, velocity window. Sticking, backward
motion and fast peaks are thereby left out. Widths are given in samples at 500 Hz and
scale with the rate: 11 samples are 22 ms. Unevenly sampled records are averaged over
that time, 11 ms to either side. Nothing is averaged or integrated across a gap in the
record.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from acquisition.clock import RATE_HZ
from acquisition.errors import SettingsError
from analysis.data.lag import ForceLag, force_lag
from analysis.data.series import Array, Indices, TractionSeries

MINIMUM_KEPT = 250  # kept samples needed for a trial to count
MINIMUM_TRAVEL_SHARE = 0.9  # of the container's length
_WIDEST = 501  # samples of smoothing: a second
_ROUNDING = 1e-3  # samples
_LONGEST_GAP = 3  # missing samples that a difference may span
_GAP = 10.0  # multiple of the median step above which a step is a gap in the record
_UNEVEN = 1.5  # largest factor between an even step and the median step
_EVEN_SHARE = 0.9  # share of even steps above which smoothing counts samples


@dataclass(frozen=True, slots=True)
class PrepareOptions:
    """How a trial is smoothed, thinned and windowed.

    Attributes:
        smoothing: width of the moving average [samples at 500 Hz], odd.
        downsample: one sample of this many is kept [samples at 500 Hz].
        slowest: lower edge of the window [m/s], included.
        fastest: upper edge of the window [m/s], included.
        container_travel: length of the container [m]; None = unknown, then travel
            does not decide whether a trial counts.

    Raises:
        SettingsError: a width below one, above 501 or even, or an empty window.
    """

    smoothing: int = 11
    downsample: int = 5
    slowest: float = 0.005
    fastest: float = 0.2
    container_travel: float | None = None

    def __post_init__(self) -> None:
        if self.smoothing < 1 or self.smoothing % 2 == 0:
            raise SettingsError(
                f"A smoothing width of {self.smoothing} samples has no centre.",
                hint="Give an odd number, e.g. 11.",
            )
        if self.smoothing > _WIDEST:
            raise SettingsError(
                f"A smoothing width of {self.smoothing} samples leaves nothing of a "
                "slip.",
                hint=f"Give at most {_WIDEST}: a second.",
            )
        if self.downsample < 1:
            raise SettingsError(
                f"One sample in {self.downsample} cannot be kept.",
                hint="Give a whole number of at least 1, e.g. 5.",
            )
        if not 0 < self.slowest < self.fastest < np.inf:
            raise SettingsError(
                f"The window {self.slowest:g} to {self.fastest:g} m/s is empty or "
                "starts at standstill.",
                hint="Give 0 < slowest < fastest, e.g. 0.005 and 0.2.",
            )

    def widths(self, series: TractionSeries) -> tuple[int, int]:
        """Return averaging width and thinning factor of a trial [samples].

        Both represent times, so they scale with the sampling rate. Rows that were
        prepared before are neither averaged nor thinned.
        """
        if series.is_prepared:
            return 1, 1
        # Times in a wrong unit give an arbitrary rate: limit widths to the trial.
        rows = float(series.t.size)
        scale = min(series.rate, rows * RATE_HZ) / RATE_HZ
        # Exact halves round down, because the rate is known to a few digits only.
        half = round(min((self.smoothing * scale - 1.0) / 2.0 - _ROUNDING, rows))
        every = round(min(self.downsample * scale, rows))
        return 2 * max(half, 0) + 1, max(every, 1)


@dataclass(frozen=True, slots=True)
class Smoothed:
    """A trial at the recorded rate after the moving average.

    Attributes:
        t: time [s], shape (n,).
        v_t: velocity [m/s], shape (n,).
        F_n: normal force [N], shape (n,).
        F_t: traction force [N], shape (n,).
        further: other inputs by name, each of shape (n,).
    """

    t: Array
    v_t: Array
    F_n: Array
    F_t: Array
    further: Mapping[str, Array] = field(default_factory=dict[str, Array])


@dataclass(frozen=True, slots=True)
class CoverageShares:
    """Shares of a trial's thinned samples by velocity; they sum to one.

    Attributes:
        window: inside the window; these are kept.
        sticking: slower than the window in either direction.
        backward: faster backward than the window's lower edge.
        fast: above the window.
    """

    window: float
    sticking: float
    backward: float
    fast: float

    @property
    def window_of_moving(self) -> float | None:
        """Share of the moving samples that are in the window; None if none moves."""
        moving = 1.0 - self.sticking
        return self.window / moving if moving > 0 else None


@dataclass(frozen=True, slots=True)
class PreparedTrial:
    """Kept samples of one trial and the smoothed record they come from.

    Attributes:
        terrain: name of the terrain.
        name: name of the trial.
        v_t: kept velocities [m/s], shape (m,).
        F_n: kept normal forces [N], shape (m,).
        F_t: kept traction forces [N], shape (m,).
        indices: rows of `smooth` that were kept, shape (m,).
        shares: shares of the thinned samples by velocity.
        smooth: the whole trial after smoothing.
        travel: distance along the slip direction [m].
        is_countable: enough kept samples and, if the container is known, enough travel.
        dropped_rows: number of rows of the record that were not finite.
        repeated_rows: number of duplicate rows of the record.
        lag: lag of the forces behind the motion; None if the trial does not
            determine it.
        stamped_lag: lag of the forces by the record's time stamps [s].
        is_simulated: the devices were simulated.
        is_foreign: the trial is a table from another program.
        widths: averaging width and thinning factor [samples].
        is_prepared: the record's rows had been prepared before.
        further: other inputs of the kept samples, shape (m, k); None without any.
    """

    terrain: str
    name: str
    v_t: Array
    F_n: Array
    F_t: Array
    indices: Indices
    shares: CoverageShares
    smooth: Smoothed
    travel: float
    is_countable: bool
    dropped_rows: int
    repeated_rows: int
    lag: ForceLag | None
    stamped_lag: float
    widths: tuple[int, int]
    is_prepared: bool
    is_simulated: bool = False
    is_foreign: bool = False
    further: Array | None = None

    @property
    def kept(self) -> int:
        """Number of kept samples."""
        return int(self.indices.size)


def moving_average(x: Array, width: int) -> Array:
    """Return the centred moving average of `x`, shape (n,).

    Near the ends the sum is divided by the number of samples present.
    """
    window = np.ones(width)
    half = width // 2
    sums = np.convolve(x, window)[half : half + x.size]
    counts = np.convolve(np.ones(x.size), window)[half : half + x.size]
    return sums / counts


def foot_velocity(t: Array, position: Array) -> Array:
    """Return the velocity of the foot [m/s], the source of the slip velocity.

    Central differences of its position over the recorded times, so a missing cycle does
    no harm; the two ends use one-sided differences. A difference over more than three
    missing samples would invent motion: its velocity is NaN, so the row is dropped.

    Args:
        t: recorded time [s], shape (n,), strictly increasing, n >= 2.
        position: position of the sole [m], shape (n,) or (n, 3).

    Returns:
        Velocity, same shape as `position`.
    """
    steps = np.diff(t)
    velocity = (_central_change(position).T / _central_change(t)).T
    # n missing samples leave a step of n + 1 periods; half a period is jitter
    gaps = np.flatnonzero(steps > (_LONGEST_GAP + 1.5) * np.median(steps))
    velocity[gaps] = velocity[gaps + 1] = np.nan
    return velocity


def _central_change(values: Array) -> Array:
    """Return next minus previous row; one-sided differences at the ends."""
    change = np.empty_like(values)
    np.subtract(values[2:], values[:-2], out=change[1:-1])
    change[0], change[-1] = values[1] - values[0], values[-1] - values[-2]
    return change


def prepare_trial(series: TractionSeries, options: PrepareOptions) -> PreparedTrial:
    """Return the kept samples of a trial: smoothed, thinned, inside the window."""
    widths, smooth = options.widths(series), smoothed(series, options)
    lag = None if series.is_prepared else force_lag(series.t, series.v_t, series.F_t)
    thinned = _thinned(series, options)
    v = smooth.v_t[thinned]
    is_kept = (v >= options.slowest) & (v <= options.fastest)
    indices = thinned[is_kept]
    parts = [(0, smooth.t.size)] if series.is_prepared else stretches(smooth.t)
    travel = _travel(smooth, parts)
    return PreparedTrial(
        terrain=series.terrain,
        name=series.name,
        v_t=smooth.v_t[indices],
        F_n=smooth.F_n[indices],
        F_t=smooth.F_t[indices],
        indices=indices,
        shares=_shares(v, options),
        smooth=smooth,
        travel=travel,
        is_countable=_is_countable(indices.size, travel, options.container_travel),
        dropped_rows=series.dropped_rows,
        repeated_rows=series.repeated_rows,
        lag=lag,
        stamped_lag=series.stamped_lag,
        widths=widths,
        is_prepared=series.is_prepared,
        is_simulated=series.is_simulated,
        is_foreign=series.is_foreign,
        further=_stacked_inputs(smooth.further, indices),
    )


def smoothed(series: TractionSeries, options: PrepareOptions) -> Smoothed:
    """Return a whole trial after the moving average, without windowing."""
    width, _ = options.widths(series)
    average = _average_over(series, options, width)
    return Smoothed(
        series.t,
        average(series.v_t),
        average(series.F_n),
        average(series.F_t),
        {name: average(x) for name, x in series.further.items()},
    )


def _average_over(
    series: TractionSeries, options: PrepareOptions, width: int
) -> Callable[[Array], Array]:
    """Return the averaging function for the columns of a trial."""
    if series.is_prepared:
        return lambda x: x
    if not is_even(series.t):
        near = _nearby(series.t, options.smoothing / RATE_HZ)
        return lambda x: _mean_of_rows(x, *near)
    parts = stretches(series.t)
    return lambda x: np.concatenate([moving_average(x[a:b], width) for a, b in parts])


def _stacked_inputs(further: Mapping[str, Array], rows: Indices) -> Array | None:
    """Return the further inputs as columns, shape (m, k); None without any."""
    return np.column_stack([x[rows] for x in further.values()]) if further else None


def stretches(t: Array) -> list[tuple[int, int]]:
    """Return (first row, end) of every stretch of a record without a gap.

    Args:
        t: time [s], shape (n,), increasing.
    """
    steps = np.diff(t)
    gaps = np.flatnonzero(steps > _GAP * np.median(steps)) + 1
    return list(pairwise([0, *(int(gap) for gap in gaps), t.size]))


def is_even(t: Array) -> bool:
    """Return whether the times of a record are evenly apart, gaps aside."""
    steps = np.diff(t)
    usual = np.median(steps)
    even = (steps > usual / _UNEVEN) & (steps < usual * _UNEVEN)
    return bool(np.mean(even) >= _EVEN_SHARE)


def _nearby(t: Array, span: float) -> tuple[Indices, Indices]:
    """Return first row and end of the rows within half a span of every row."""
    first = np.searchsorted(t, t - span / 2.0, "left")
    return first, np.searchsorted(t, t + span / 2.0, "right")


def _mean_of_rows(x: Array, first: Indices, end: Indices) -> Array:
    """Return the mean of x over rows `first` to `end`, each of shape (n,)."""
    sums = np.concatenate([[0.0], np.cumsum(x)])
    return (sums[end] - sums[first]) / (end - first)


def _thinned(series: TractionSeries, options: PrepareOptions) -> Indices:
    """Return the rows that remain after thinning, before the velocity window."""
    _, every = options.widths(series)
    if series.is_prepared or is_even(series.t):
        return np.arange(0, series.t.size, every)
    number = np.floor((series.t - series.t[0]) / (options.downsample / RATE_HZ))
    return np.flatnonzero(np.diff(number, prepend=-1.0) > 0.0)


def _travel(smooth: Smoothed, parts: Sequence[tuple[int, int]]) -> float:
    """Return the distance travelled [m], summed over stretches of the record."""
    travels = (np.trapezoid(smooth.v_t[a:b], smooth.t[a:b]) for a, b in parts)
    return float(sum(travels))


def _shares(v: Array, options: PrepareOptions) -> CoverageShares:
    return CoverageShares(
        window=float(np.mean((v >= options.slowest) & (v <= options.fastest))),
        sticking=float(np.mean(np.abs(v) < options.slowest)),
        backward=float(np.mean(v <= -options.slowest)),
        fast=float(np.mean(v > options.fastest)),
    )


def _is_countable(kept: int, travel: float, container: float | None) -> bool:
    is_crossed = container is None or travel >= MINIMUM_TRAVEL_SHARE * container
    return kept >= MINIMUM_KEPT and is_crossed
