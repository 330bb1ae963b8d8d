"""Friction of each motor from recorded rows: a pure function, with its intervals.

Speed at half of the break-away excess and the excess itself are sought on a grid; for
each of them everything else is linear, so weighted least squares with priors give it:

    y = S(w) (sense (F_c + mu (|tau| - tau_0) + r_s sin + r_c cos) + F_a) + b w
        + k inertia + Y_g d

Gravity is known to a prior, or within half a radian nothing could tell it from an
asymmetry. Residuals of neighbouring rows are alike: intervals come from sums over
blocks of 2 s (a sandwich), not from rows taken as independent.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from acquisition.errors import SettingsError
from wam.calibration.sliding import SlidingRows, check_enough
from wam.model.constants import ArmConstants, Array
from wam.model.friction import MotorFriction, motor_turns

LARGEST_RESIDUAL = 0.2  # of Coulomb friction, rms on the held-out way
LEAST_BOUND = 0.7  # of the estimate: its lower bound
_STRIBECK = np.geomspace(0.005, 0.08, 13)  # rad/s of the joint
_EXCESS = np.linspace(0.0, 0.7, 15)  # s - 1
_SIGMAS = 1.96
_LOAD = 0.03  # N m per N m; this and the next two: deviations of priors
_RIPPLE = 0.1  # of Coulomb friction
_INERTIA = 0.1  # of the model's
_PEAK_WEIGHT = 3.0  # of one break-away against one row of sliding
_FEWEST_LEGS = 3  # on which a motor shows how it gives way
_ASSUMED_PRESLIDING, _PRESLIDING = 2e-3, (2e-4, 5e-3)  # rad of the joint
_NOISE = 0.03  # of Coulomb friction: rows are not known better
_COLUMNS = 7  # F_c, F_a, mu, r_s, r_c, b, inertia; then gravity


@dataclass(frozen=True, slots=True)
class FrictionFit:
    """Friction as identified.

    Attributes:
        friction: of the motors.
        deviation: standard deviation of its Coulomb torques [N m], shape (7,).
        asymmetry_deviation: of its asymmetries [N m], shape (7,).
        residual: rms on the held-out way as shares of Coulomb friction, shape (7,).
        rows: how many rows each motor had, shape (7,).
        moments: what is to be added to the first moments with which the weight was
            subtracted [kg m], shape (7, 3).
    """

    friction: MotorFriction
    deviation: Array
    asymmetry_deviation: Array
    residual: Array
    rows: tuple[int, ...]
    moments: Array = field(default_factory=lambda: np.zeros((7, 3)))

    @property
    def lower_bound(self) -> Array:
        """Coulomb torque that the motors surely have [N m], shape (7,)."""
        return self.friction.coulomb - _SIGMAS * self.deviation

    def sliding_left(self, share: float) -> Array:
        """Return the most that sliding motors keep of friction [N m], shape (7,).

        The upper end (95 %) of each, less what is compensated.

        Args:
            share: of the lower end that float takes off the hand, 0 = none.
        """
        asymmetry = np.abs(self.friction.asymmetry)
        most = self.friction.coulomb + asymmetry + _SIGMAS * self.deviation
        return most - share * np.maximum(self.lower_bound - asymmetry, 0.0)


@dataclass(frozen=True, slots=True)
class _MotorFit:
    """One motor."""

    stribeck: float
    excess: float
    load_at: float
    values: Array
    covariance: Array


def fit_friction(
    constants: ArmConstants,
    rows: Sequence[SlidingRows],
    held_out: Sequence[SlidingRows],
    gravity_deviation: Array,
) -> FrictionFit:
    """Return the friction that explains `rows`, judged on `held_out`.

    Args:
        constants: of the arm.
        rows: of the seven motors.
        held_out: of the seven motors on a way that is not fitted.
        gravity_deviation: to which first moments are known [kg m], shape (21,).

    Raises:
        SettingsError: a motor did not slide enough either way.
    """
    for motor, shown in enumerate(rows, 1):
        check_enough(motor, shown)
    turns = motor_turns(constants)
    fits = [
        _fit_motor(shown, float(scale), gravity_deviation)
        for shown, scale in zip(rows, turns, strict=True)
    ]
    friction = _friction_of(fits, turns, [shown.compliance for shown in rows])
    residual = _residuals(friction, fits, held_out)
    # What another way does not confirm is no noise: it does not average out.
    doubt = (residual * friction.coulomb)[:, None]
    random = np.sqrt([np.diag(fit.covariance)[:2] for fit in fits])
    deviations = np.hypot(random, doubt)
    return FrictionFit(
        friction=friction,
        deviation=deviations[:, 0],
        asymmetry_deviation=deviations[:, 1],
        residual=residual,
        rows=tuple(len(shown) for shown in rows),
        moments=_moments(rows, fits, gravity_deviation),
    )


def _moments(
    rows: Sequence[SlidingRows], fits: Sequence[_MotorFit], gravity_deviation: Array
) -> Array:
    """Return the one change of first moments that all motors show, shape (7, 3).

    Each motor was fitted with a change of its own, which belongs to no arm.
    """
    normal = np.diag(1.0 / np.maximum(gravity_deviation, 1e-9) ** 2)
    torques = np.zeros(21)
    for shown, fit in zip(rows, fits, strict=True):
        columns = _columns(shown, fit.stribeck, fit.excess, fit.load_at)
        rest = shown.friction - columns[:, :_COLUMNS] @ fit.values[:_COLUMNS]
        weights = _weights(shown, float(np.median(np.abs(shown.friction))))
        weighted = shown.gravity * weights[:, None]
        normal += weighted.T @ weighted
        torques += weighted.T @ (rest * weights)
    return np.asarray(np.linalg.solve(normal, torques), np.float64).reshape(7, 3)


def _friction_of(
    fits: Sequence[_MotorFit], turns: Array, compliances: Sequence[Array]
) -> MotorFriction:
    """Return the fits in the form of the model.

    Presliding is what a motor gives way at the torque that breaks it away; 2 mrad is
    ASSUMED of motors that showed it too seldom, and the range of that kept.
    """
    values = np.array([fit.values[:_COLUMNS] for fit in fits])
    coulomb = values[:, 0]
    broken = coulomb * (1.0 + np.array([fit.excess for fit in fits]))
    shown = [
        float(np.median(given)) if len(given) >= _FEWEST_LEGS else np.nan
        for given in compliances
    ]
    seen = np.clip(np.array(shown) * broken / turns, *_PRESLIDING)
    presliding = np.where(np.isnan(seen), _ASSUMED_PRESLIDING, seen)
    return MotorFriction(
        coulomb=coulomb,
        asymmetry=values[:, 1],
        load=np.maximum(values[:, 2], 0.0),
        load_at=np.array([fit.load_at for fit in fits]),
        breakaway=1.0 + np.array([fit.excess for fit in fits]),
        stribeck=np.array([fit.stribeck for fit in fits]),
        viscous=np.maximum(values[:, 5], 0.0),
        ripple_sin=values[:, 3] / coulomb,
        ripple_cos=values[:, 4] / coulomb,
        presliding=presliding * turns,
    )


def check_friction(fit: FrictionFit) -> None:
    """Refuse a friction that does not describe the arm.

    Raises:
        SettingsError: the held-out way contradicts it, or it is hardly known.
    """
    hint = "The arm must not be touched. Is the gravity model that of this foot?"
    worst = int(fit.residual.argmax())
    if not fit.residual[worst] <= LARGEST_RESIDUAL:
        raise SettingsError(
            f"The friction of motor {worst + 1} is not of this form: the way that was "
            f"kept back deviates by {fit.residual[worst]:.2f} of Coulomb friction rms "
            f"(limit {LARGEST_RESIDUAL:g}).",
            hint=hint,
        )
    shares = fit.lower_bound / fit.friction.coulomb
    least = int(shares.argmin())
    if fit.friction.coulomb.min() <= 0.0 or not shares[least] >= LEAST_BOUND:
        raise SettingsError(
            f"The Coulomb friction of motor {least + 1} is hardly known: its lower "
            f"bound is {shares[least]:.2f} of it (at least {LEAST_BOUND:g}).",
            hint=hint,
        )


def _fit_motor(rows: SlidingRows, turns: float, gravity: Array) -> _MotorFit:
    """Return the best of the grid, refined once around it."""
    load_at = float(np.abs(rows.load).mean())
    scale = float(np.median(np.abs(rows.friction)))
    coarse = _search(rows, turns * _STRIBECK, _EXCESS, load_at, scale, gravity)
    stribeck, excess = _search(
        rows,
        coarse[0] * np.geomspace(0.8, 1.25, 7),
        np.maximum(coarse[1] + np.linspace(-0.05, 0.05, 11), 0.0),
        load_at,
        scale,
        gravity,
    )
    A, y, prior = _system(rows, stribeck, excess, load_at, scale, gravity)
    values, normal = _solve(A, y, prior)
    covariance = _sandwich(A, y - A @ values, rows.block, normal)
    return _MotorFit(stribeck, excess, load_at, values, covariance)


def _search(
    rows: SlidingRows,
    stribecks: Array,
    excesses: Array,
    load_at: float,
    scale: float,
    gravity: Array,
) -> tuple[float, float]:
    """Return (w_s, s - 1) of the least weighted squares on the grid of both."""
    best, least = (float(stribecks[0]), float(excesses[0])), np.inf
    for stribeck in stribecks.tolist():
        for excess in excesses.tolist():
            A, y, prior = _system(rows, stribeck, excess, load_at, scale, gravity)
            values, _ = _solve(A, y, prior)
            cost = float(((y - A @ values) ** 2).sum() + (prior * values**2).sum())
            if cost < least:
                best, least = (stribeck, excess), cost
    return best


def _system(
    rows: SlidingRows,
    stribeck: float,
    excess: float,
    load_at: float,
    scale: float,
    gravity: Array,
) -> tuple[Array, Array, Array]:
    """Return the weighted columns, the weighted torques and the prior's weights.

    Args:
        rows: of one motor.
        stribeck: w_s [rad/s].
        excess: s - 1.
        load_at: load at which Coulomb friction is stated [N m].
        scale: the motor's friction [N m].
        gravity: how well each of the first moments is known [kg m].
    """
    A = _columns(rows, stribeck, excess, load_at)
    weights = _weights(rows, scale)
    weights *= np.where(rows.speed == 0.0, _PEAK_WEIGHT, 1.0)
    ripple = 1.0 / (_RIPPLE * scale) ** 2
    loose = [0.0, 0.0, 1.0 / _LOAD**2, ripple, ripple, 0.0, 1.0 / _INERTIA**2]
    prior = np.concatenate([loose, 1.0 / np.maximum(gravity, 1e-9) ** 2])
    return A * weights[:, None], rows.friction * weights, prior


def _weights(rows: SlidingRows, scale: float) -> Array:
    """Return what rows of sliding count, `scale` [N m] being a motor's friction."""
    return 1.0 / np.hypot(_NOISE * scale, _INERTIA * rows.inertia)


def _columns(
    rows: SlidingRows, stribeck: float, excess: float, load_at: float
) -> Array:
    """Return what multiplies the values, shape (n, 28)."""
    weakening = 1.0 + excess / (1.0 + (rows.speed / stribeck) ** 2)
    along = rows.sense * weakening
    columns = [
        along,
        weakening,
        along * (np.abs(rows.load) - load_at),
        along * np.sin(rows.angle),
        along * np.cos(rows.angle),
        rows.speed,
        rows.inertia,
    ]
    return np.column_stack([*columns, rows.gravity])


def _solve(A: Array, y: Array, prior: Array) -> tuple[Array, Array]:
    """Return the values and the matrix of the normal equations."""
    normal = A.T @ A + np.diag(prior + 1e-12)
    return np.asarray(np.linalg.solve(normal, A.T @ y), dtype=np.float64), normal


def _sandwich(A: Array, rest: Array, block: NDArray[np.int64], normal: Array) -> Array:
    """Return the covariance of the values, residuals being alike within a block."""
    names, which = np.unique(block, return_inverse=True)
    scores = np.zeros((len(names), A.shape[1]))
    np.add.at(scores, which, A * rest[:, None])
    inverse = np.linalg.inv(normal)
    factor = len(names) / max(len(names) - 1, 1)
    return factor * inverse @ (scores.T @ scores) @ inverse


def _residuals(
    friction: MotorFriction, fits: Sequence[_MotorFit], rows: Sequence[SlidingRows]
) -> Array:
    """Return what `rows` leave unexplained, rms as share of Coulomb, shape (7,)."""
    shares: list[float] = []
    for coulomb, fit, shown in zip(friction.coulomb, fits, rows, strict=True):
        A = _columns(shown, fit.stribeck, fit.excess, fit.load_at)
        rest = shown.friction - A @ fit.values
        shares.append(float(np.sqrt(np.mean(rest**2)) / coulomb))
    return np.array(shares)
