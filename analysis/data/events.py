"""Slip detection: the foot breaks away, slides, and sticks again.

A slip is a stretch of smoothed v_t above 0.03 m/s that rises above 0.12 m/s. The peak
force before the slip, the lowest force during it and the bounce-back at its end
distinguish loose stones from a plate.
"""

from dataclasses import dataclass

import numpy as np

from analysis.data.prepare import Smoothed
from analysis.data.series import Array

SLIP_SPEED = 0.12  # m/s that makes a stretch a slip
EDGE_SPEED = 0.03  # m/s where a slip begins and ends
BOUNCE_SPEED = -0.01  # m/s below which the foot bounces back
SAG_SHARE = 0.08  # relative loss of force before the drop that counts as sag

LONGEST_STEP = 1.0  # s between two rows of one slip
_LOADING = 0.6  # s before the onset in which the force peak is searched
_RELEASE = 0.12  # s after the onset in which the peak may still come
_FLOOR = 0.15  # s after the peak speed in which the lowest force is searched
_BOUNCE = 0.6  # s after the end in which the foot may bounce back
_SPIKE = 0.15  # s before the lowest velocity in which the spike is searched
_DROP_LEAD = 0.1  # s before the onset in which the steepest drop is searched
_SAG_FROM, _SAG_TO = 0.030, 0.006  # s before the drop over which force is averaged


@dataclass(frozen=True, slots=True)
class Slip:
    """One slip.

    Attributes:
        onset: time at which v_t rose above 0.03 m/s [s].
        end: time at which v_t fell below 0.03 m/s again [s].
        peak_speed: largest v_t [m/s].
        length: distance slipped [m].
        peak: largest F_t around the onset [N].
        floor: smallest F_t while the foot slid [N].
        bounce_speed: lowest v_t after the end [m/s], None without a bounce-back.
        spike: F_t at re-sticking above the floor [N], None without a bounce-back.
        has_sag: F_t fell by 8 % before the steepest drop.
    """

    onset: float
    end: float
    peak_speed: float
    length: float
    peak: float
    floor: float
    bounce_speed: float | None
    spike: float | None
    has_sag: bool

    @property
    def has_bounce(self) -> bool:
        """Whether the foot bounced back after the slip."""
        return self.bounce_speed is not None


def find_slips(trial: Smoothed) -> tuple[Slip, ...]:
    """Return the slips of a smoothed trial in time order."""
    return tuple(
        _describe(trial, first, last)
        for first, last in _stretches(trial.v_t > EDGE_SPEED, _after_gaps(trial.t))
        if trial.v_t[first : last + 1].max() > SLIP_SPEED
    )


def _after_gaps(t: Array) -> list[int]:
    """Return the rows that follow a gap in the record."""
    return [int(row) + 1 for row in np.flatnonzero(np.diff(t) > LONGEST_STEP)]


def _stretches(is_above: np.ndarray, cuts: list[int]) -> list[tuple[int, int]]:
    """Return first and last row of every run of True; runs are split at the cuts."""
    edges = np.diff(np.concatenate([[0], is_above.astype(np.int8), [0]]))
    inner = [cut for cut in cuts if is_above[cut - 1] and is_above[cut]]
    starts = sorted([*np.flatnonzero(edges == 1).tolist(), *inner])
    stops = sorted([*np.flatnonzero(edges == -1).tolist(), *inner])
    return [(a, b - 1) for a, b in zip(starts, stops, strict=True)]


def _describe(trial: Smoothed, first: int, last: int) -> Slip:
    t, v, F_t = trial.t, trial.v_t, trial.F_t
    fastest = first + int(np.argmax(v[first : last + 1]))
    onset, end = float(t[first]), float(t[last])
    floor = float(F_t[_between(t, onset, t[fastest] + _FLOOR)].min())
    bounce_speed, spike = _bounce(trial, end, floor)
    return Slip(
        onset=onset,
        end=end,
        peak_speed=float(v[fastest]),
        length=float(np.trapezoid(v[first : last + 1], t[first : last + 1])),
        peak=float(F_t[_between(t, onset - _LOADING, onset + _RELEASE)].max()),
        floor=floor,
        bounce_speed=bounce_speed,
        spike=spike,
        has_sag=_has_sag(trial, onset),
    )


def _between(t: Array, start: float, stop: float) -> slice:
    """Return the rows with start <= t <= stop."""
    return slice(
        int(np.searchsorted(t, start, "left")), int(np.searchsorted(t, stop, "right"))
    )


def _bounce(
    trial: Smoothed, end: float, floor: float
) -> tuple[float | None, float | None]:
    after = _between(trial.t, end, end + _BOUNCE)
    lowest = after.start + int(np.argmin(trial.v_t[after]))
    if trial.v_t[lowest] >= BOUNCE_SPEED:
        return None, None
    catch = _between(trial.t, float(trial.t[lowest]) - _SPIKE, float(trial.t[lowest]))
    return float(trial.v_t[lowest]), float(trial.F_t[catch].max() - floor)


def _has_sag(trial: Smoothed, onset: float) -> bool:
    """Return whether F_t sagged before its steepest drop."""
    t, F_t = trial.t, trial.F_t
    # only up to the onset: during the slip the foot chatters and the force drops again
    falling = _between(t, onset - _DROP_LEAD, onset)
    if falling.stop - falling.start < 2:
        return False
    slope = np.diff(F_t[falling]) / np.diff(t[falling])
    drop = float(t[falling.start + int(np.argmin(slope))])
    before = F_t[_between(t, drop - _SAG_FROM, drop - _SAG_TO)]
    loaded = F_t[_between(t, drop - _LOADING, drop)]
    if before.size == 0 or loaded.max() <= 0:
        return False
    return bool(before.mean() <= (1.0 - SAG_SHARE) * loaded.max())
