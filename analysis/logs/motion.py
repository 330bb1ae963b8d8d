"""Resampling of joints and wrench to an even time grid, and joint velocities."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from acquisition.clock import RATE_HZ
from analysis.data.filters import local_polynomial
from analysis.data.prepare import PrepareOptions
from analysis.data.series import Array
from analysis.logs.channels import JointChannel

_ORDER = 2  # of the local polynomial
_SPAN = PrepareOptions().smoothing / RATE_HZ  # s, as the moving average
LONGEST_GAP = 3.5  # steps bridged by interpolation, as in analysis.data.prepare
_NS = 1e-9
_ROUNDING = 1e-6  # tolerance of times [steps]


@dataclass(frozen=True, slots=True)
class JointMotion:
    """Joints on an even grid.

    Attributes:
        t: time since the first joint message [s], shape (n,), evenly spaced except for
            gaps.
        step: time step [s].
        q: positions, shape (n, joints).
        qd: velocities by a local polynomial of the positions, shape (n, joints).
        dropped: number of rows of the grid that lie in gaps.
    """

    t: Array
    step: float
    q: Array
    qd: Array
    dropped: int


def joint_motion(channel: JointChannel) -> JointMotion:
    """Resample positions to the rate of the joints and compute velocities.

    Gaps of over 3.5 steps are not bridged.
    """
    times = seconds_since(channel.clock.times_ns, int(channel.clock.times_ns[0]))
    step = float(np.median(np.diff(times)))
    longest = LONGEST_GAP * step
    # only where there are messages, because a log may pause for hours
    parts = [
        np.arange(
            np.ceil(first / step - _ROUNDING), np.floor(last / step + _ROUNDING) + 1.0
        )
        for first, last in _covered_spans(times, longest)
    ]
    t: Array = np.concatenate(parts) * np.float64(step) + 0.0  # no -0.0
    q = interpolated(t, times, channel.q)
    qd = np.zeros_like(q)
    for first, end in _stretches(t, step):
        qd[first:end] = _slope(q[first:end], step)
    dropped = round(float(times[-1]) / step) + 1 - len(t)
    return JointMotion(t, step, q, qd, max(dropped, 0))


def _covered_spans(times: Array, longest: float) -> list[tuple[float, float]]:
    """Return (first, last) time of every stretch without a gap over `longest` [s]."""
    breaks = np.flatnonzero(np.diff(times) > longest)
    firsts = times[np.concatenate([[0], breaks + 1])]
    lasts = times[np.concatenate([breaks, [len(times) - 1]])]
    return list(zip(firsts.tolist(), lasts.tolist(), strict=True))


def rows_averaged(step: float) -> int:
    """Return the width of a 22 ms moving average in rows of a grid; odd."""
    return 2 * max(0, round((_SPAN / step - 1.0) / 2.0)) + 1


def seconds_since(times_ns: NDArray[np.int64], origin_ns: int) -> Array:
    """Convert times to seconds since an origin."""
    return (times_ns - origin_ns).astype(np.float64) * _NS


def interpolated(at: Array, times: Array, values: Array) -> Array:
    """Interpolate columns linearly, shape (len(at), columns)."""
    return np.column_stack([np.interp(at, times, column) for column in values.T])


def covered(times: Array, at: Array, longest: float) -> NDArray[np.bool_]:
    """Return which times lie between two messages at most `longest` [s] apart."""
    after = np.clip(np.searchsorted(times, at, "right"), 1, len(times) - 1)
    is_within = (at >= times[0] - 1e-9) & (at <= times[-1] + 1e-9)
    return is_within & (times[after] - times[after - 1] <= longest)


def mean_around(times: Array, values: Array, at: Array, span: float) -> Array:
    """Return the mean of columns over `span` around times; NaN next to gaps.

    The mean is that of the linear interpolation, so it works for messages faster or
    slower than `span`.

    Args:
        times: times of the messages [s], shape (n,).
        values: values of the messages, shape (n, columns).
        at: times of the means [s], shape (m,).
        span: width of the mean [s].
    """
    steps = np.diff(times)[:, None]
    areas = np.vstack(
        [
            np.zeros(values.shape[1]),
            np.cumsum(steps * (values[1:] + values[:-1]) / 2.0, axis=0),
        ]
    )
    low, high = (
        _area_until(times, values, areas, at + side * span / 2.0) for side in (-1, 1)
    )
    mean = (high - low) / span
    longest = LONGEST_GAP * max(float(np.median(steps)), span)
    mean[~covered(times, at, longest)] = np.nan
    return mean


def _area_until(times: Array, values: Array, areas: Array, at: Array) -> Array:
    """Integrate the linear interpolation up to the times `at`."""
    k = np.clip(np.searchsorted(times, at, "right") - 1, 0, len(times) - 2)
    beyond = at - times[k]
    width = times[k + 1] - times[k]
    slope = (values[k + 1] - values[k]) / width[:, None]
    return areas[k] + beyond[:, None] * (values[k] + 0.5 * slope * beyond[:, None])


def _stretches(t: Array, step: float) -> list[tuple[int, int]]:
    """Return (first, end) of the stretches of a grid without missing rows."""
    if len(t) < 2:
        return [(0, len(t))]
    breaks = np.flatnonzero(np.diff(t) > 1.5 * step) + 1
    edges = [0, *(int(row) for row in breaks), len(t)]
    return list(pairwise(edges))


def _slope(q: Array, step: float) -> Array:
    """Compute the velocities of a stretch by a local polynomial of 22 ms."""
    width = max(rows_averaged(step), 3)
    if len(q) < max(width, _ORDER + 1):
        return np.gradient(q, step, axis=0) if len(q) > 1 else np.zeros_like(q)
    order = min(_ORDER, width - 1)
    return local_polynomial(q, width, order, deriv=1, step=step)
