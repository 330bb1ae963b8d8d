"""What a log does not say and its numbers do: tare, weight, lag, ground, direction.

Each is an `Estimate` with its figure, its spread and how it was found; where nothing
can be found, that is said or refused.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition.errors import SettingsError
from analysis.data.lag import force_lag
from analysis.data.plausibility import PRESSED, SLOWEST
from analysis.data.series import Array
from wam.model.constants import GRAVITY

Bools = NDArray[np.bool_]

# unloaded
LIFTED = 0.010  # m above the lowest place of the foot
SHORTEST_REST = 0.5  # s
_QUIET = 4.0  # times the noise that a mean of 50 ms may wander
_MEAN = 0.05  # s
LARGEST_DRIFT = 1.0  # N between the halves of a span that is said to be unloaded
# weight
SMALLEST_TURN = 20.0  # degrees of orientation, unloaded
HEAVIEST = 20.0  # kg
# lag
LONGEST_LAG = 0.1  # s
_RISING = 0.001  # m/s: friction has turned round at this velocity
_EVENT = 0.15  # s before and after a start or stop
_APART = 0.1  # s between two events
FEWEST_EVENTS = 3
_EXPLAINED = 0.5  # of the ratio F_t/F_n around starts and stops
_FLAT = 0.002  # of it, below the best, within which lags are as good
SURE = 0.005  # s: no lag is known better, the maximum is flat
# ground
SHORTEST_WAY = 0.1  # m in the plane
LARGEST_MISFIT = 0.003  # m
_WIDE = 0.02  # m across the way, from which a plane can be told
_UPRIGHT = 0.1  # of a direction in the ground: nearly along its normal
_STEEPEST = 0.5  # of the normal along z: ground of 60 degrees
_SPAN = 3.5  # standard deviations from end to end of an even distribution


@dataclass(frozen=True, slots=True)
class Estimate:
    """One thing that was given or found.

    Attributes:
        name: what it is.
        value: numbers in `unit`.
        unit: of value and spread; "" where there is none.
        spread: how well it is known, in `unit`; empty where it was given.
        how: given, or how it was found.
    """

    name: str
    value: tuple[float, ...]
    unit: str
    spread: tuple[float, ...]
    how: str


def find_unloaded(t: Array, wrench: Array, height: Array) -> Bools:
    """Return the rows of all spans of half a second in which a lifted foot is quiet.

    A sensor that stands otherwise in another of them shows the weight that it carries.

    Args:
        t: time [s], shape (n,).
        wrench: raw [N, N m], shape (n, 6).
        height: of the foot [m], shape (n,).

    Raises:
        SettingsError: there is none of half a second.
    """
    is_lifted = height > np.nanmin(height) + LIFTED
    step = float(np.median(np.diff(t)))
    is_quiet = is_lifted & _is_quiet(wrench[:, :3], round(_MEAN / step) or 1)
    rows = np.zeros(len(t), bool)
    for first, end in _runs(is_quiet):
        if t[end - 1] - t[first] >= SHORTEST_REST:
            rows[first:end] = True
    if not rows.any():
        raise SettingsError(
            f"No unloaded span of {SHORTEST_REST} s: the foot is nowhere quiet "
            f"{LIFTED * 1e3:.0f} mm above its lowest place.",
            hint="Name one by --tare T0:T1 in seconds of the log, or a log of the free "
            "foot by --tare FILE.",
        )
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


def _runs(flags: Bools) -> list[tuple[int, int]]:
    """Return (first, end) of every stretch of true rows."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]])))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def tare_of(
    wrench: Array, rotation: Array, sign: float, mass: float | None
) -> tuple[Array, float, list[Estimate]]:
    """Return bias, mass, and both as estimates, of unloaded readings.

    raw = b + s m R^T g_w + noise; m is given, or fitted where the sensor turned, else
    its weight in the one orientation is a part of b.

    Args:
        wrench: raw [N, N m], shape (n, 6).
        rotation: sensor to base, shape (n, 3, 3).
        sign: +1 where the sensor reads the load on it.
        mass: of everything below the gauges [kg]; None = not known.

    Raises:
        SettingsError: the span is not unloaded, or the mass impossible.
    """
    down = -GRAVITY * sign * rotation[:, 2, :]  # of a kilogram, as the sensor reads it
    turned = turn_deg(rotation)
    if mass is None and turned >= SMALLEST_TURN:
        mass, error = _fitted_mass(wrench[:, :3], down)
        weight = Estimate(
            "mass", (mass,), "kg", (error,), f"fitted over a turn of {turned:.0f} deg"
        )
    elif mass is None:
        weight = Estimate(
            "mass",
            (0.0,),
            "kg",
            (),
            "not identifiable: the sensor kept its orientation, its weight there is in "
            "the tare",
        )
    else:
        weight = Estimate("mass", (mass,), "kg", (), "given")
    rest = np.array(wrench)
    rest[:, :3] -= (mass or 0.0) * down
    bias, sd = rest.mean(axis=0), rest.std(axis=0)
    half = len(rest) // 2
    drift = np.abs(rest[:half].mean(axis=0) - rest[half:].mean(axis=0))
    if np.linalg.norm(drift[:3]) > LARGEST_DRIFT:
        raise SettingsError(
            f"The span of the tare is not unloaded: its halves differ by "
            f"{np.linalg.norm(drift[:3]):.1f} N.",
            hint="Name one in which the foot is in the air by --tare T0:T1; give "
            "--tool-mass where the sensor carries a weight and turns.",
        )
    spread = np.maximum(drift, sd / np.sqrt(len(rest)))
    tare = Estimate(
        "tare",
        tuple(bias.tolist()),
        "N, N m",
        tuple(spread.tolist()),
        f"mean of {len(rest)} unloaded rows, noise {np.mean(sd[:3]):.3f} N",
    )
    return bias, mass or 0.0, [tare, weight]


def _fitted_mass(force: Array, down: Array) -> tuple[float, float]:
    """Return mass and its standard error [kg] of readings in several orientations."""
    centred, y = down - down.mean(axis=0), force - force.mean(axis=0)
    power = float(np.sum(centred**2))
    mass = float(np.sum(centred * y)) / power
    rest = y - mass * centred
    if not 0.0 <= mass <= HEAVIEST:
        raise SettingsError(
            f"The unloaded sensor carries {mass:.2f} kg by its readings.",
            hint="Check --acts and --sensor, or give --tool-mass.",
        )
    return mass, float(np.sqrt(np.mean(rest**2) / power))


def turn_deg(rotation: Array) -> float:
    """Return the largest turn from the first orientation [degrees]."""
    cosines = (np.einsum("nij,ij->n", rotation, rotation[0]) - 1.0) / 2.0
    return float(np.degrees(np.arccos(np.clip(cosines.min(), -1.0, 1.0))))


@dataclass(frozen=True, slots=True)
class Lag:
    """How much later than the joints the wrench is stamped.

    Attributes:
        seconds: the best value [s].
        low: smallest that is as good [s].
        high: largest that is as good [s].
        how: in words.
    """

    seconds: float
    low: float
    high: float
    how: str


def find_lag(t: Array, v_t: Array, F_n: Array, F_t: Array) -> Lag | None:
    """Return how late the forces are by starts and stops of the foot; None = unknown.

    F_t / F_n = a + b tanh(v_t / v_0), v_0 = 1 mm/s: friction turns round with the
    motion, whatever its size. Around starts and stops that is fitted at every lag, and
    the best fit is the lag; both sides are smoothed alike before. Where friction does
    not turn round so, the foot's inertia decides (`analysis.data.lag`).

    Args:
        t: time, even [s], shape (n,).
        v_t: velocity along the way [m/s], shape (n,).
        F_n: normal force by its stamps, smoothed as the velocity is [N], shape (n,).
        F_t: traction, the same [N], shape (n,).
    """
    step = float(np.median(np.diff(t)))
    events = _events(t, v_t, F_n)
    if len(events) >= FEWEST_EVENTS:
        half = round(_EVENT / step)
        most = int(LONGEST_LAG / step)
        ratio = F_t / np.maximum(F_n, PRESSED)
        basis = np.tanh(v_t / _RISING)
        events = [k for k in events if half + most < k < len(t) - half - most]
        windows = [np.arange(k - half, k + half) for k in events]
        if len(windows) >= FEWEST_EVENTS:
            shifts = np.arange(-most, most + 1)
            every = np.array([_sums(ratio, basis, w, shifts) for w in windows])
            explained = _explained(every.sum(axis=0))
            best = int(explained.argmax())
            if explained[best] >= _EXPLAINED and 0 < best < len(shifts) - 1:
                tops = [int(_explained(one).argmax()) for one in every]
                each = np.float64(step) * shifts[tops]
                flat = np.float64(step) * shifts[explained >= explained[best] - _FLAT]
                return _lag_of(shifts[best] * step, each, flat, step)
    found = force_lag(t, v_t, F_t)
    if found is None:
        return None
    sure = max(SURE, 2.0 * step)
    return Lag(
        found.seconds,
        found.seconds - sure,
        found.seconds + sure,
        f"inertia of the foot explains {found.explained:.0%} of the force",
    )


def _lag_of(best: float, each: Array, flat: Array, step: float) -> Lag:
    sure = max(SURE, 2.0 * step)
    low, high = np.quantile(each, (0.25, 0.75))
    return Lag(
        float(best),
        float(min(low, flat[0], best - sure)),
        float(max(high, flat[-1], best + sure)),
        f"F_t/F_n turns with the motion at {len(each)} starts and stops",
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


def find_ground(foot: Array, given_normal: Array | None) -> tuple[Array, Estimate]:
    """Return the normal of the ground by the way of the pressed foot.

    Args:
        foot: its positions in the base, pressed [m], shape (n, 3).
        given_normal: in the axes of the base; None = from the way.

    Raises:
        SettingsError: the way is too short or leaves its plane.
    """
    if given_normal is not None:
        normal = given_normal / np.linalg.norm(given_normal)
        return normal, Estimate("normal", tuple(normal.tolist()), "", (), "given")
    centred = foot - foot.mean(axis=0)
    _, _, axes = np.linalg.svd(centred, full_matrices=False)
    extents = np.ptp(centred @ axes.T, axis=0)
    if extents[0] < SHORTEST_WAY:
        raise SettingsError(
            f"The pressed foot moves {extents[0] * 1e3:.0f} mm; from less than "
            f"{SHORTEST_WAY * 1e3:.0f} mm its ground cannot be told.",
            hint="Give --normal X,Y,Z and --along X,Y,Z in the axes of the base.",
        )
    is_plane = extents[1] >= _WIDE
    if is_plane:
        normal, how = axes[2], "plane of the pressed foot's way"
    else:
        up = np.array([0.0, 0.0, 1.0])
        normal = up - (up @ axes[0]) * axes[0]
        how = "across a straight way, level sideways"
    normal = normal / np.linalg.norm(normal) * (1.0 if normal[2] >= 0.0 else -1.0)
    if normal[2] < _STEEPEST:
        raise SettingsError(
            "The pressed foot's way lies in an upright plane: a wall, or forces of "
            "another kind than those of the ground.",
            hint="Check the tare and --tool-mass, or give --normal X,Y,Z.",
        )
    line = centred @ normal
    misfit = float(np.sqrt(np.mean(line**2)))
    if misfit > LARGEST_MISFIT:
        raise SettingsError(
            f"The pressed foot leaves its plane by {misfit * 1e3:.1f} mm rms (limit "
            f"{LARGEST_MISFIT * 1e3:.0f}).",
            hint="Give --normal X,Y,Z, or take one stroke by --trials T0:T1.",
        )
    angle = float(np.degrees(np.arctan2(_SPAN * misfit, extents[1 if is_plane else 0])))
    spread = (angle,) if is_plane else (angle, float("nan"))
    how += f", misfit {misfit * 1e3:.2f} mm; spread in degrees"
    return normal, Estimate("normal", tuple(normal.tolist()), "", spread, how)


def find_direction(
    foot: Array, strokes: Sequence[tuple[int, int]], normal: Array, along: Array | None
) -> tuple[Array, Estimate]:
    """Return the direction of the slip in the plane of the ground.

    Args:
        foot: its positions [m], shape (n, 3).
        strokes: (first, end) of the stretches in which it is pressed.
        normal: of the ground, shape (3,).
        along: as given, in the axes of the base; None = the sum of the strokes' chords.

    Raises:
        SettingsError: the foot comes back to where it began, or `along` is the normal.
    """
    chord = along
    if chord is None:
        chord = np.sum([foot[end - 1] - foot[first] for first, end in strokes], axis=0)
    flat = chord - (chord @ normal) * normal
    size = float(np.linalg.norm(flat))
    if along is None and size < SHORTEST_WAY / 2.0:
        raise SettingsError(
            f"The pressed foot ends {size * 1e3:.0f} mm from where it began: it has no "
            "direction.",
            hint="Give --along X,Y,Z in the axes of the base.",
        )
    if size <= _UPRIGHT * float(np.linalg.norm(chord)):
        raise SettingsError(
            "The direction of the slip stands on the ground as its normal does.",
            hint="Check --along and --normal.",
        )
    direction = flat / size
    values = tuple(direction.tolist())
    if along is not None:
        return direction, Estimate("direction", values, "", (), "given")
    across = np.cross(normal, direction)
    ways = [foot[first:end] - foot[first] for first, end in strokes]
    aside = max(float(np.std(way @ across)) for way in ways)
    length = max(float(np.ptp(way @ direction)) for way in ways)
    spread = float(np.degrees(np.arctan2(_SPAN * aside, length)))
    how = "chord of the pressed foot's way; spread in degrees"
    return direction, Estimate("direction", values, "", (spread,), how)


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
    for first, end in _runs(F_n > threshold):
        if merged and t[first] - t[merged[-1][1] - 1] < join:
            merged[-1] = (merged[-1][0], end)
        else:
            merged.append((first, end))
    return merged
