"""Estimates from a log alone: quiet spans, weight, lag, ground.

The estimates are never applied: an import prints them next to the stated values, and
`--list` offers them as a command line to edit. If there is no estimate, `Estimate` has
no value and states why.
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
LIFTED = 0.010  # m above the lowest position of the foot
SHORTEST_REST = 0.5  # s
_QUIET = 4.0  # limit of the change of a 50 ms mean as a multiple of the noise
STEADY = 0.1  # N, least limit: the noise of a filtered sensor is not white
_MEAN = 0.05  # s
# weight
SMALLEST_TURN = 20.0  # degrees between orientations, unloaded
# lag
LONGEST_LAG = 0.1  # s, largest lag that is searched
_RISING = 0.001  # m/s, velocity scale of the reversal of friction
_EVENT = 0.15  # s before and after a start or stop
_SPACING = 0.1  # s, smallest time between two events
FEWEST_EVENTS = 3
_EXPLAINED = 0.5  # least explained share of the variance of F_t/F_n around events
_FLAT = 0.002  # difference in that share within which lags are equally good
SURE = 0.005  # s, lower limit of the uncertainty, because the maximum is flat
# ground
SHORTEST_PATH = 0.1  # m of path in the plane
_WIDE = 0.02  # m of width of the path from which a plane can be fitted
# sole
_ALIKE = 1e4  # condition number of the forces beyond which they are parallel
_UNSURE = 0.02  # m
_SPAN = 3.5  # width of a uniform distribution in standard deviations


@dataclass(frozen=True, slots=True)
class Estimate:
    """Estimate of one quantity.

    Attributes:
        value: estimate in the unit of the quantity; empty if unavailable.
        spread: uncertainty in the unit that `how` names.
        how: method, or reason why there is no estimate.
    """

    value: tuple[float, ...]
    spread: tuple[float, ...]
    how: str


def nothing(why: str) -> Estimate:
    """Make an estimate without value."""
    return Estimate((), (), why)


def find_quiet(t: Array, wrench: Array, height: Array) -> Bools:
    """Return the rows of all spans of at least 0.5 s in which a lifted foot is quiet.

    Different orientations of the sensor in these spans reveal the weight it carries.

    Args:
        t: time [s], shape (n,).
        wrench: raw readings [N, N m], shape (n, 6).
        height: position of the foot along the normal [m], shape (n,).
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
    """Return where the mean force does not change."""
    if len(force) <= 2 * width:
        return np.zeros(len(force), bool)
    noise = np.nanmedian(np.abs(np.diff(force, axis=0)), axis=0) / 0.9539
    kernel = np.ones(width) / width
    is_quiet = np.array(np.isfinite(force).all(axis=1))
    filled = np.where(np.isfinite(force), force, 0.0)
    for axis, sd in enumerate(noise):
        mean = np.convolve(filled[:, axis], kernel, "same")
        ahead, behind = np.roll(mean, -width), np.roll(mean, width)
        change = np.abs(ahead - behind)
        is_quiet &= change <= max(_QUIET * float(sd), STEADY)
    is_quiet[:width] = is_quiet[-width:] = False
    return is_quiet


def runs(flags: Bools) -> list[tuple[int, int]]:
    """Return (first, end) of every run of true rows."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]])))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def find_mass(force: Array, rotation: Array, sign: float) -> Estimate:
    """Estimate the mass below the gauges [kg] from the free foot in several poses.

    raw = b + s m R^T g_w + noise, with b and m fitted.

    Args:
        force: raw force [N], shape (n, 3).
        rotation: sensor to base, shape (n, 3, 3).
        sign: +1 if the sensor reads the load on it.
    """
    if not len(force):
        return nothing("the foot is never quiet in the air")
    turned = turn_deg(rotation)
    if turned < SMALLEST_TURN:
        return nothing(
            f"the quiet foot turned by {turned:.0f} degrees, {SMALLEST_TURN:.0f} "
            "are needed"
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
    """Return the weight of 1 kg in the sensor's axes and sign [N], shape (n, 3)."""
    return -GRAVITY * sign * rotation[:, 2, :]


def turn_deg(rotation: Array) -> float:
    """Return the largest turn from the first orientation [degrees]."""
    cosines = (np.einsum("nij,ij->n", rotation, rotation[0]) - 1.0) / 2.0
    return float(np.degrees(np.arccos(np.clip(cosines.min(), -1.0, 1.0))))


def find_lag(t: Array, step: float, values: Array) -> Estimate:
    """Estimate the lag of the forces [s] from starts and stops; spread: from, to.

    F_t / F_n = a + b tanh(v_t / v_0), v_0 = 1 mm/s: friction reverses with the motion,
    whatever its magnitude. This is fitted around starts and stops at every lag, and the
    best fit is the lag; both sides are smoothed equally before. If friction does not
    reverse in this way, the foot's inertia is used (`analysis.data.lag`).

    Args:
        t: evenly spaced time [s], shape (n,).
        step: time step [s].
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
    by_inertia = force_lag(t, v_t, F_t)
    if by_inertia is None:
        return nothing(f"{by_events.how}; nor does the foot's inertia")
    return Estimate(
        (by_inertia.seconds,),
        (by_inertia.seconds - sure, by_inertia.seconds + sure),
        f"inertia of the foot explains {by_inertia.explained:.0%} of the force; from, "
        "to",
    )


def _lag_by_events(
    t: Array, v_t: Array, F_n: Array, F_t: Array, step: float, sure: float
) -> Estimate:
    half, most = round(_EVENT / step), int(LONGEST_LAG / step)
    events = _events(t, v_t, F_n)
    inside = [k for k in events if half + most < k < len(t) - half - most]
    if len(inside) < FEWEST_EVENTS:
        return nothing(
            f"{len(inside)} starts and stops of the pressed foot are too few, "
            f"{FEWEST_EVENTS} are needed"
        )
    ratio = F_t / np.maximum(F_n, PRESSED)
    basis = np.tanh(v_t / _RISING)
    windows = [np.arange(k - half, k + half) for k in inside]
    shifts = np.arange(-most, most + 1)
    sums = np.array([_sums(ratio, basis, w, shifts) for w in windows])
    explained = _explained(sums.sum(axis=0))
    best = int(explained.argmax())
    count = f"at {len(inside)} starts and stops"
    if explained[best] < _EXPLAINED:
        return nothing(
            f"the motion explains {explained[best]:.0%} of F_t/F_n {count}, "
            f"{_EXPLAINED:.0%} are needed"
        )
    if best in (0, len(shifts) - 1):
        return nothing(
            f"F_t/F_n {count} fits best at {shifts[best] * step * 1e3:.0f} ms, the "
            "end of the search range"
        )
    lags = np.float64(step) * shifts[[int(_explained(s).argmax()) for s in sums]]
    flat = np.float64(step) * shifts[explained >= explained[best] - _FLAT]
    value = float(shifts[best] * step)
    low, high = np.quantile(lags, (0.25, 0.75))
    return Estimate(
        (value,),
        (
            float(min(low, flat[0], value - sure)),
            float(max(high, flat[-1], value + sure)),
        ),
        f"F_t/F_n reverses with the motion {count}; from, to",
    )


def _events(t: Array, v_t: Array, F_n: Array) -> list[int]:
    """Return the rows at which a pressed foot starts or stops sliding forward."""
    crossings = np.flatnonzero(np.diff((v_t > _RISING).astype(int)))
    step = float(np.median(np.diff(t)))
    half = round(_EVENT / step)
    events: list[int] = []
    for k in crossings.tolist():
        near = slice(max(0, k - half), k + half)
        is_sliding = bool((v_t[near] > SLOWEST).any())
        is_pressed = bool((F_n[near] > PRESSED).all())
        is_new = not events or t[k] - t[events[-1]] > _SPACING
        if is_sliding and is_pressed and is_new:
            events.append(k)
    return events


def _sums(
    ratio: Array, basis: Array, rows: NDArray[np.intp], shifts: NDArray[np.intp]
) -> Array:
    """Return the sums for a line fit of the ratio at every shift, shape (shifts, 6)."""
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
    """Return the share of the variance explained by the line, shape (shifts,)."""
    n, x, xx, y, xy, yy = sums.T
    s_xx, s_xy, s_yy = xx - x * x / n, xy - x * y / n, yy - y * y / n
    with np.errstate(divide="ignore", invalid="ignore"):
        share = s_xy**2 / (s_xx * s_yy)
    return np.where(np.isfinite(share) & (s_xy > 0.0), share, 0.0)


def find_normal(foot: Array, shortest: float = SHORTEST_PATH) -> Estimate:
    """Estimate the ground normal in the base frame from the path of the pressed foot.

    Args:
        foot: positions of the pressed foot in the base frame [m], shape (n, 3).
        shortest: length of path that is needed [m].
    """
    if len(foot) < 3:
        return nothing("the foot is never pressed")
    centred = foot - foot.mean(axis=0)
    _, _, axes = np.linalg.svd(centred, full_matrices=False)
    extents = np.ptp(centred @ axes.T, axis=0)
    if extents[0] < shortest:
        return nothing(
            f"the pressed foot moves {extents[0] * 1e3:.0f} mm, "
            f"{shortest * 1e3:.0f} mm are needed"
        )
    is_wide = abs(axes[2, 2]) >= abs(axes[1, 2])  # sideways; a heave is no width
    is_plane = extents[1] >= _WIDE and is_wide
    if is_plane:
        normal, how = axes[2], "plane of the pressed foot's path"
    else:
        up = np.array([0.0, 0.0, 1.0])
        normal = up - (up @ axes[0]) * axes[0]
        how = "normal to a straight path, assumed level sideways"
    size = float(np.linalg.norm(normal))
    if size < _WIDE:
        return nothing("the pressed foot's path is vertical")
    normal = normal / size * (1.0 if normal[2] >= 0.0 else -1.0)
    misfit = float(np.sqrt(np.mean((centred @ normal) ** 2)))
    angle = float(np.degrees(np.arctan2(_SPAN * misfit, extents[1 if is_plane else 0])))
    how += f", misfit {misfit * 1e3:.2f} mm; +- degrees"
    return Estimate(tuple(normal.tolist()), (angle,), how)


def find_sole(force: Array, moment: Array, normal: Array) -> Estimate:
    """Estimate where along the normal the force acts [mm], 0 = at the foot's origin.

    moment = d x force + c, with d and c fitted: friction that starts and stops turns
    the force, and its lines of action meet at a sole that is a point. A centre of
    pressure that moves with the friction shifts the estimate; one that moves otherwise
    widens its spread.

    Args:
        force: force of the ground, in axes fixed to the foot [N], shape (n, 3).
        moment: moment about the foot's origin, same axes [N m], shape (n, 3).
        normal: normal of the ground, same axes, shape (3,).
    """
    if len(force) < 3:
        return nothing("the foot is never pressed")
    x, y, z = (force - force.mean(axis=0)).T
    zero = np.zeros(len(force))
    # the matrix of d -> d x force at every row, shape (n, 3, 3)
    cross = np.array([[zero, z, -y], [-z, zero, x], [y, -x, zero]]).transpose(2, 0, 1)
    rest = moment - moment.mean(axis=0)
    power = np.einsum("nij,nik->jk", cross, cross) / len(force)
    if np.linalg.cond(power) > _ALIKE:
        return nothing("the force keeps its direction")
    at = np.linalg.solve(power, np.einsum("nij,ni->j", cross, rest) / len(force))
    misfit = float(np.mean((rest - np.einsum("nij,j->ni", cross, at)) ** 2))
    # of single rows: those of a log are not independent
    spread = float(np.sqrt(misfit * (normal @ np.linalg.solve(power, normal))))
    if spread > _UNSURE:
        return nothing(
            f"the moments place it within {spread * 1e3:.0f} mm only, "
            f"{_UNSURE * 1e3:.0f} mm are needed"
        )
    how = "moments of a force that turns, if the sole is a point; +- mm"
    return Estimate((float(at @ normal) * 1e3,), (spread * 1e3,), how)


def find_direction(
    foot: Array, strokes: Sequence[tuple[int, int]], normal: Array
) -> Estimate:
    """Estimate the slip direction in the ground plane from the chords of the strokes.

    Args:
        foot: positions of the foot [m], shape (n, 3).
        strokes: (first, end) rows of the stretches in which it is pressed.
        normal: normal of the ground, shape (3,).
    """
    paths = [foot[first:end] - foot[first] for first, end in strokes if end > first]
    chord = np.sum([path[-1] for path in paths] or [np.zeros(3)], axis=0)
    flat = chord - (chord @ normal) * normal
    size = float(np.linalg.norm(flat))
    if size < SHORTEST_PATH / 2.0:
        return nothing(
            f"the pressed foot ends {size * 1e3:.0f} mm from where it began, "
            f"{SHORTEST_PATH / 2.0 * 1e3:.0f} mm are needed"
        )
    direction = flat / size
    across = np.cross(normal, direction)
    aside = max(float(np.std(path @ across)) for path in paths)
    length = max(float(np.ptp(path @ direction)) for path in paths)
    spread = float(np.degrees(np.arctan2(_SPAN * aside, length)))
    how = "chord of the pressed foot's path; +- degrees"
    return Estimate(tuple(direction.tolist()), (spread,), how)


def pressed_stretches(
    t: Array, F_n: Array, threshold: float, join: float
) -> Sequence[tuple[int, int]]:
    """Return (first, end) rows of the stretches in which the foot is pressed.

    Args:
        t: time [s], shape (n,).
        F_n: normal force [N], shape (n,).
        threshold: normal force above which it is pressed [N].
        join: lifts shorter than this are ignored [s].
    """
    merged: list[tuple[int, int]] = []
    for first, end in runs(F_n > threshold):
        if merged and t[first] - t[merged[-1][1] - 1] < join:
            merged[-1] = (merged[-1][0], end)
        else:
            merged.append((first, end))
    return merged
