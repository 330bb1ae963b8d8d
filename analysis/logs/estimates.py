"""What the numbers of a log show by themselves: quiet spans, weight, lag, ground.

Nothing here is applied: an import prints each beside what was stated, and `--list`
offers them as a command line to be read and edited. Where nothing can be found, an
`Estimate` has no value and says what was looked at.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.data.lag import force_lag
from analysis.data.plausibility import PRESSED, SLOWEST
from analysis.data.prepare import moving_average
from analysis.data.series import Array
from analysis.logs.motion import rows_averaged
from wam.model.constants import GRAVITY

Bools = NDArray[np.bool_]

# unloaded
LIFTED = 0.010  # m above the lowest place of the foot
SHORTEST_REST = 0.5  # s
_QUIET = 4.0  # times the noise that a mean of 50 ms may wander
_MEAN = 0.05  # s
# weight
SMALLEST_TURN = 20.0  # degrees of orientation, unloaded
# lag
LONGEST_LAG = 0.1  # s that are looked at
_RISING = 0.001  # m/s: friction has turned round at this velocity
_EVENT = 0.15  # s before and after a start or stop
_APART = 0.1  # s between two events
FEWEST_EVENTS = 3
_EXPLAINED = 0.5  # of the ratio F_t/F_n around starts and stops
_FLAT = 0.002  # of it, below the best, within which lags are as good
SURE = 0.005  # s: no lag is known better, the maximum is flat
# ground
SHORTEST_WAY = 0.1  # m in the plane
_WIDE = 0.02  # m across the way, from which a plane can be told
_SPAN = 3.5  # standard deviations from end to end of an even distribution


@dataclass(frozen=True, slots=True)
class Estimate:
    """One thing that the numbers show.

    Attributes:
        value: in the unit of what it is an estimate of; empty where nothing is shown.
        spread: how well it is known, in the unit that `how` names.
        how: how it was found, or why it was not.
    """

    value: tuple[float, ...]
    spread: tuple[float, ...]
    how: str


def nothing(why: str) -> Estimate:
    """An estimate that the log does not show."""
    return Estimate((), (), why)


def find_quiet(t: Array, wrench: Array, height: Array) -> Bools:
    """Rows of all spans of half a second in which a lifted foot is quiet.

    A sensor that stands otherwise in another of them shows the weight that it carries.

    Args:
        t: time [s], shape (n,).
        wrench: raw [N, N m], shape (n, 6).
        height: of the foot along the normal of the ground [m], shape (n,).
    """
    is_lifted = height > np.nanmin(height) + LIFTED
    step = float(np.median(np.diff(t)))
    is_quiet = is_lifted & _is_quiet(wrench[:, :3], round(_MEAN / step) or 1)
    rows = np.zeros(len(t), bool)
    for first, end in runs(is_quiet):
        if t[end - 1] - t[first] >= SHORTEST_REST:
            rows[first:end] = True
    return rows


def _is_quiet(force: Array, width: int) -> Bools:
    """Return where forces do not wander from those of the rows around them."""
    if len(force) <= 2 * width:
        return np.zeros(len(force), bool)
    noise = np.nanmedian(np.abs(np.diff(force, axis=0)), axis=0) / 0.9539
    kernel = np.ones(width) / width
    is_quiet = np.array(np.isfinite(force).all(axis=1))
    filled = np.where(np.isfinite(force), force, 0.0)
    for axis, sd in enumerate(noise):
        mean = np.convolve(filled[:, axis], kernel, "same")
        ahead, behind = np.roll(mean, -width), np.roll(mean, width)
        wander = np.abs(ahead - behind)
        is_quiet &= wander <= _QUIET * max(float(sd), 1e-6)
    is_quiet[:width] = is_quiet[-width:] = False
    return is_quiet


def runs(flags: Bools) -> list[tuple[int, int]]:
    """Return (first, end) of every stretch of true rows."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]])))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def find_mass(force: Array, rotation: Array, sign: float) -> Estimate:
    """Mass below the gauges [kg] by readings of the free foot in several orientations.

    raw = b + s m R^T g_w + noise, b and m free.

    Args:
        force: raw [N], shape (n, 3).
        rotation: sensor to base, shape (n, 3, 3).
        sign: +1 where the sensor reads the load on it.
    """
    if not len(force):
        return nothing("the foot is nowhere quiet in the air")
    turned = turn_deg(rotation)
    if turned < SMALLEST_TURN:
        return nothing(
            f"the quiet foot turned by {turned:.0f} degrees, {SMALLEST_TURN:.0f} "
            "show it"
        )
    down = gravity_in(rotation, sign)
    centred, y = down - down.mean(axis=0), force - force.mean(axis=0)
    power = float(np.sum(centred**2))
    mass = float(np.sum(centred * y)) / power
    error = float(np.sqrt(np.mean((y - mass * centred) ** 2) / power))
    return Estimate(
        (mass,), (error,), f"readings over a turn of {turned:.0f} degrees; +- kg"
    )


def gravity_in(rotation: Array, sign: float) -> Array:
    """Weight of a kilogram as the sensor reads it [N], shape (n, 3)."""
    return -GRAVITY * sign * rotation[:, 2, :]


def turn_deg(rotation: Array) -> float:
    """Return the largest turn from the first orientation [degrees]."""
    cosines = (np.einsum("nij,ij->n", rotation, rotation[0]) - 1.0) / 2.0
    return float(np.degrees(np.arccos(np.clip(cosines.min(), -1.0, 1.0))))


def find_lag(t: Array, step: float, values: Array) -> Estimate:
    """How late the forces are [s] by starts and stops of the foot; spread: from, to.

    F_t / F_n = a + b tanh(v_t / v_0), v_0 = 1 mm/s: friction turns round with the
    motion, whatever its size. Around starts and stops that is fitted at every lag, and
    the best fit is the lag; both sides are smoothed alike before. Where friction does
    not turn round so, the foot's inertia decides (`analysis.data.lag`).

    Args:
        t: time, even [s], shape (n,).
        step: between two rows [s].
        values: v_t, smoothed [m/s], F_t and F_n by their stamps [N], shape (n, 3).
    """
    sound = np.isfinite(values).all(axis=1)
    width = rows_averaged(step)
    v_t, F_t, F_n = values.T
    F_t, F_n = (
        moving_average(np.interp(t, t[sound], F[sound]), width) for F in (F_t, F_n)
    )
    sure = max(SURE, 2.0 * step)
    by_events = _lag_by_events(t, v_t, F_n, F_t, step, sure)
    if by_events.value:
        return by_events
    found = force_lag(t, v_t, F_t)
    if found is None:
        return nothing(f"{by_events.how}; nor does the foot's inertia")
    return Estimate(
        (found.seconds,),
        (found.seconds - sure, found.seconds + sure),
        f"inertia of the foot explains {found.explained:.0%} of the force; from, to",
    )


def _lag_by_events(
    t: Array, v_t: Array, F_n: Array, F_t: Array, step: float, sure: float
) -> Estimate:
    half, most = round(_EVENT / step), int(LONGEST_LAG / step)
    events = _events(t, v_t, F_n)
    inside = [k for k in events if half + most < k < len(t) - half - most]
    if len(inside) < FEWEST_EVENTS:
        return nothing(
            f"{len(inside)} starts and stops of the pressed foot do not show it, "
            f"{FEWEST_EVENTS} do"
        )
    ratio = F_t / np.maximum(F_n, PRESSED)
    basis = np.tanh(v_t / _RISING)
    windows = [np.arange(k - half, k + half) for k in inside]
    shifts = np.arange(-most, most + 1)
    every = np.array([_sums(ratio, basis, w, shifts) for w in windows])
    explained = _explained(every.sum(axis=0))
    best = int(explained.argmax())
    count = f"at {len(inside)} starts and stops"
    if explained[best] < _EXPLAINED:
        return nothing(
            f"the motion explains {explained[best]:.0%} of F_t/F_n {count}, "
            f"{_EXPLAINED:.0%} would show it"
        )
    if best in (0, len(shifts) - 1):
        return nothing(
            f"F_t/F_n {count} fits best at {shifts[best] * step * 1e3:.0f} ms, the "
            "end of what is looked at"
        )
    each = np.float64(step) * shifts[[int(_explained(one).argmax()) for one in every]]
    flat = np.float64(step) * shifts[explained >= explained[best] - _FLAT]
    value = float(shifts[best] * step)
    low, high = np.quantile(each, (0.25, 0.75))
    return Estimate(
        (value,),
        (
            float(min(low, flat[0], value - sure)),
            float(max(high, flat[-1], value + sure)),
        ),
        f"F_t/F_n turns with the motion {count}; from, to",
    )


def _events(t: Array, v_t: Array, F_n: Array) -> list[int]:
    """Return the rows at which a pressed foot starts or stops to slide forward."""
    crossings = np.flatnonzero(np.diff((v_t > _RISING).astype(int)))
    step = float(np.median(np.diff(t)))
    half = round(_EVENT / step)
    events: list[int] = []
    for k in crossings.tolist():
        near = slice(max(0, k - half), k + half)
        is_sliding = bool((v_t[near] > SLOWEST).any())
        is_pressed = bool((F_n[near] > PRESSED).all())
        is_new = not events or t[k] - t[events[-1]] > _APART
        if is_sliding and is_pressed and is_new:
            events.append(k)
    return events


def _sums(
    ratio: Array, basis: Array, rows: NDArray[np.intp], shifts: NDArray[np.intp]
) -> Array:
    """Return the sums of a line fit of the ratio at every shift, shape (shifts, 6)."""
    x = basis[rows]
    y = ratio[rows[None, :] + shifts[:, None]]
    ones = np.ones(len(shifts))
    return np.column_stack(
        [
            ones * len(x),
            ones * x.sum(),
            ones * (x @ x),
            y.sum(axis=1),
            y @ x,
            np.einsum("ij,ij->i", y, y),
        ]
    )


def _explained(sums: Array) -> Array:
    """Return the share of the variance that the line explains, shape (shifts,)."""
    n, x, xx, y, xy, yy = sums.T
    s_xx, s_xy, s_yy = xx - x * x / n, xy - x * y / n, yy - y * y / n
    with np.errstate(divide="ignore", invalid="ignore"):
        share = s_xy**2 / (s_xx * s_yy)
    return np.where(np.isfinite(share) & (s_xy > 0.0), share, 0.0)


def find_normal(foot: Array) -> Estimate:
    """Normal of the ground in the base by the way of the pressed foot.

    Args:
        foot: its positions in the base, pressed [m], shape (n, 3).
    """
    if len(foot) < 3:
        return nothing("the foot is never pressed")
    centred = foot - foot.mean(axis=0)
    _, _, axes = np.linalg.svd(centred, full_matrices=False)
    extents = np.ptp(centred @ axes.T, axis=0)
    if extents[0] < SHORTEST_WAY:
        return nothing(
            f"the pressed foot moves {extents[0] * 1e3:.0f} mm, "
            f"{SHORTEST_WAY * 1e3:.0f} mm show it"
        )
    is_plane = extents[1] >= _WIDE
    if is_plane:
        normal, how = axes[2], "plane of the pressed foot's way"
    else:
        up = np.array([0.0, 0.0, 1.0])
        normal = up - (up @ axes[0]) * axes[0]
        how = "across a straight way, taken as level sideways"
    size = float(np.linalg.norm(normal))
    if size < _WIDE:
        return nothing("the pressed foot's way is upright")
    normal = normal / size * (1.0 if normal[2] >= 0.0 else -1.0)
    misfit = float(np.sqrt(np.mean((centred @ normal) ** 2)))
    angle = float(np.degrees(np.arctan2(_SPAN * misfit, extents[1 if is_plane else 0])))
    how += f", misfit {misfit * 1e3:.2f} mm; +- degrees"
    return Estimate(tuple(normal.tolist()), (angle,), how)


def find_direction(
    foot: Array, strokes: Sequence[tuple[int, int]], normal: Array
) -> Estimate:
    """Direction of the slip in the plane of the ground by the chords of the strokes.

    Args:
        foot: its positions [m], shape (n, 3).
        strokes: (first, end) of the stretches in which it is pressed.
        normal: of the ground, shape (3,).
    """
    ways = [foot[first:end] - foot[first] for first, end in strokes if end > first]
    chord = np.sum([way[-1] for way in ways] or [np.zeros(3)], axis=0)
    flat = chord - (chord @ normal) * normal
    size = float(np.linalg.norm(flat))
    if size < SHORTEST_WAY / 2.0:
        return nothing(
            f"the pressed foot ends {size * 1e3:.0f} mm from where it began, "
            f"{SHORTEST_WAY / 2.0 * 1e3:.0f} mm show it"
        )
    direction = flat / size
    across = np.cross(normal, direction)
    aside = max(float(np.std(way @ across)) for way in ways)
    length = max(float(np.ptp(way @ direction)) for way in ways)
    spread = float(np.degrees(np.arctan2(_SPAN * aside, length)))
    how = "chord of the pressed foot's way; +- degrees"
    return Estimate(tuple(direction.tolist()), (spread,), how)


def pressed_stretches(
    t: Array, F_n: Array, threshold: float, join: float
) -> Sequence[tuple[int, int]]:
    """Return (first, end) of the stretches in which the foot is pressed.

    Args:
        t: time [s], shape (n,).
        F_n: normal force [N], shape (n,).
        threshold: above which it is pressed [N].
        join: shorter lifts are none [s].
    """
    merged: list[tuple[int, int]] = []
    for first, end in runs(F_n > threshold):
        if merged and t[first] - t[merged[-1][1] - 1] < join:
            merged[-1] = (merged[-1][0], end)
        else:
            merged.append((first, end))
    return merged
