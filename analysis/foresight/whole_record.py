"""Filters and features of a whole record at once: the same bits as sample by sample.

`signals` runs in the loop, this module over records. Sums run in the same order, every
element is rounded as a plain float is, and logarithms are those of the same library, so
that what is learnt from records holds for what is seen live; a test compares the bits.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import log

import numpy as np

from acquisition.sample import Record
from analysis.data.series import Array, Indices
from analysis.foresight import signals as live
from analysis.foresight.signals import EVERY, FEATURES, MEMORY, PERIOD, FootSample


@dataclass(frozen=True, slots=True, eq=False)
class FootRecord:
    """The cycles of a record as foresight reads them, shape (n,) each.

    Attributes:
        cycle: number.
        host_ns: time [ns].
        x: way of the sole along x_T [m].
        F_t: traction [N].
        F_n: normal force [N].
    """

    cycle: Indices
    host_ns: Indices
    x: Array
    F_t: Array
    F_n: Array

    @classmethod
    def of(cls, cycles: Record, along: Sequence[float]) -> "FootRecord":
        """Return cycles of a loop with the ways of the sole along x_T.

        Args:
            cycles: records of traction_msgs/Cycle, shape (n,).
            along: x_T in the base frame, three numbers.
        """
        sole, forces = cycles["foot_position"], cycles["traction"]
        way = along[0] * sole[:, 0] + along[1] * sole[:, 1]  # in a fixed order
        return cls(
            cycle=cycles["cycle"].astype(np.intp),
            host_ns=cycles["host_ns"].astype(np.intp),
            x=way + along[2] * sole[:, 2],
            F_t=np.ascontiguousarray(forces[:, 1]),
            F_n=np.ascontiguousarray(forces[:, 2]),
        )

    @property
    def samples(self) -> Iterator[FootSample]:
        """The cycles one by one."""
        columns = (self.cycle, self.host_ns, self.x, self.F_t, self.F_n)
        return map(FootSample, *(column.tolist() for column in columns))

    def stretches(self) -> Iterator["FootRecord"]:
        """Give the stretches without a missing cycle, finite rows only."""
        is_finite = np.isfinite(self.x) & np.isfinite(self.F_t) & np.isfinite(self.F_n)
        rows = np.flatnonzero(is_finite)
        breaks = np.flatnonzero(np.diff(self.cycle[rows]) != 1) + 1
        for part in np.split(rows, breaks):
            if part.size:
                yield FootRecord(
                    cycle=self.cycle[part],
                    host_ns=self.host_ns[part],
                    x=self.x[part],
                    F_t=self.F_t[part],
                    F_n=self.F_n[part],
                )


@dataclass(frozen=True, slots=True, eq=False)
class RecordTicks:
    """What a record shows every 10 ms while the filters are warm.

    Attributes:
        tick: number, shape (n,).
        host_ns: time [ns], shape (n,).
        features: of `signals`, shape (n, 23).
        motion: v_t [m/s], F_t [N], F_n [N], shape (n, 3).
    """

    tick: Indices
    host_ns: Indices
    features: Array
    motion: Array


def ticks_of_record(record: FootRecord) -> RecordTicks:
    """Return the ticks of a record; a missing cycle restarts the filters."""
    parts = [_ticks(stretch) for stretch in record.stretches()]
    whole = [part for part in parts if part.tick.size]
    if not whole:
        nothing = np.zeros(0, dtype=np.intp)
        shape = (0, len(FEATURES))
        return RecordTicks(nothing, nothing, np.zeros(shape), np.zeros((0, 3)))
    return RecordTicks(
        tick=np.concatenate([part.tick for part in whole]),
        host_ns=np.concatenate([part.host_ns for part in whole]),
        features=np.concatenate([part.features for part in whole]),
        motion=np.concatenate([part.motion for part in whole]),
    )


def _ticks(stretch: FootRecord) -> RecordTicks:
    rows = np.arange(MEMORY, stretch.cycle.size)  # warm
    rows = rows[stretch.cycle[rows] % EVERY == 0]
    filtered = _Filtered.of(stretch)
    motion = (filtered.v_t, filtered.F_t, filtered.F_n)
    return RecordTicks(
        tick=stretch.cycle[rows] // EVERY,
        host_ns=stretch.host_ns[rows],
        features=_features(stretch, filtered, rows),
        motion=np.column_stack([column[rows] for column in motion]),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Filtered:
    """The filters of `Signals` after every sample, shape (n,) each."""

    v_t: Array
    F_t: Array
    F_n: Array
    power_F: Array
    power_v: Array
    slip_ended: Array
    slip_x: Array
    largest: Array

    @classmethod
    def of(cls, stretch: FootRecord) -> "_Filtered":
        x, F_t, F_n = stretch.x, stretch.F_t, stretch.F_n
        v_t = _slope(x, 15)
        v_t[0] = 0.0  # the first sample has no way yet
        smooth_t, smooth_n = _lagged(F_t, live.SMOOTH), _lagged(F_n, live.SMOOTH)
        high = smooth_t - _lagged(F_t, live.SLOW)
        power_F = _lagged(high * high, live.POWER, first=0.0)
        power_v = _lagged(v_t * v_t, live.POWER, first=0.0)
        slips = _since_slips(v_t, smooth_t, x)
        return cls(v_t, smooth_t, smooth_n, power_F, power_v, *slips)


def _ago(values: Array, samples: int, before: float | None = None) -> Array:
    """Return the values so many samples earlier; `before` the first it stood still."""
    shifted = np.empty(values.size)
    shifted[:samples] = values[0] if before is None else before
    shifted[samples:] = values[: max(values.size - samples, 0)]
    return shifted


def _slope(values: Array, n: int) -> Array:
    """Return the slope of the line through the last n samples, as `Slope` has it."""
    first = float(values[0])
    half, oldest = 0.5 * (n - 1), _ago(values, n)
    steps = values - oldest
    steps[0] = n * first
    sums = np.add.accumulate(steps)
    moments = np.empty(values.size)
    moments[0] = half * (n * first)
    moments[1:] = sums[:-1] - n * oldest[1:]
    moments = np.add.accumulate(moments)
    return (half * sums - moments) * (12.0 / (n * (n * n - 1.0) * PERIOD))


def _lagged(values: Array, keep: float, first: float | None = None) -> Array:
    """Return y = value + keep (y - value), begun at the first value or at `first`."""
    numbers: list[float] = values.tolist()
    state = numbers[0] if first is None else first
    found = [state]
    for value in numbers[1:]:
        state = value + keep * (state - value)
        found.append(state)
    return np.array(found)


def _since_slips(v_t: Array, F_t: Array, x: Array) -> tuple[Array, Array, Array]:
    """Return count and way at the end of the last slip, and the largest F_t since."""
    forces, ways = F_t.tolist(), x.tolist()
    ended, way, largest, is_slipping = 0, ways[0], forces[0], False
    found = [(ended, way, largest)]
    for row, v in enumerate(v_t.tolist()[1:], 1):
        if is_slipping:
            if v < live.EDGE_SPEED:
                is_slipping = False
                ended, way, largest = row + 1, ways[row], forces[row]
        elif v > live.SLIP_SPEED:
            is_slipping = True
        elif forces[row] > largest:
            largest = forces[row]
        found.append((ended, way, largest))
    ends, from_, most = np.array(found, dtype=np.float64).T
    return ends, from_, most


def _features(stretch: FootRecord, of: _Filtered, rows: Indices) -> Array:
    """Return `Signals.features` of rows, shape (n, 23)."""
    x, push = stretch.x, stretch.F_t
    F_t, F_n, v = of.F_t[rows], of.F_n[rows], of.v_t[rows]
    force, load = _at_least(F_t, live.LEAST_FORCE), _at_least(F_n, live.LEAST_LOAD)
    way50, way100 = ((x - _ago(x, n))[rows] for n in (50, 100))
    v30, v100, v200 = (x - _ago(x, 15))[rows] / 0.03, way50 / 0.1, way100 / 0.2
    waited = (rows + 1 - of.slip_ended[rows]) * PERIOD
    gone = _at_most(_at_least(x[rows] - of.slip_x[rows], 0.0), live.FARTHEST)
    pushed50, pushed100 = ((push - _ago(push, n))[rows] for n in (50, 100))
    speeds = [_log(_at_least(each, live.LEAST_SPEED)) for each in (v30, v100, v200)]
    columns = [
        _log(force),
        F_t / load,
        _log(force / load),
        F_n,
        _slope(push, 25)[rows],
        _slope(push, 60)[rows],
        _slope(stretch.F_n, 25)[rows],
        (stretch.F_n - _ago(stretch.F_n, 100))[rows],
        v30,
        v100,
        v200,
        *speeds,
        v - _ago(of.v_t, 25, before=0.0)[rows],
        _log(_at_least(_at_most(waited, live.LONGEST), live.LEAST_TIME)),
        _log(gone + live.LEAST_WAY),
        gone,
        F_t / _at_least(of.largest[rows], live.LEAST_PEAK),
        np.sqrt(_at_least(of.power_F[rows], 0.0)),
        np.sqrt(_at_least(of.power_v[rows], 0.0)),
        way50 - pushed50 / live.STIFFNESS,
        way100 - pushed100 / live.STIFFNESS,
    ]
    return np.column_stack(columns)


def _at_least(values: Array, least: float) -> Array:
    """Return max(value, least) as Python has it, signed zeros too."""
    return np.where(least > values, least, values)


def _at_most(values: Array, most: float) -> Array:
    return np.where(most < values, most, values)


def _log(values: Array) -> Array:
    """Return logarithms of the mathematics library; numpy's own may differ."""
    return np.array([log(value) for value in values.tolist()])
