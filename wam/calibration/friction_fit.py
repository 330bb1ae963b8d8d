"""Friction fit of each motor to recorded rows, with confidence intervals.

Stribeck velocity w_s (at half of the break-away excess) and excess s - 1 are found by
grid search; the other parameters are linear and found by weighted least squares with
priors:

    y = S(w) (sense (F_c + mu (|tau| - tau_0) + r_s sin + r_c cos) + F_a) + b w
        + k inertia + Y_g d

The prior on gravity is needed: over half a radian, gravity and asymmetry cannot be told
apart. Residuals of neighbouring rows are correlated, so the covariance is the sandwich
estimator over blocks of 2 s.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from acquisition.errors import SettingsError
from wam.calibration.sliding import SlidingRows, check_row_count
from wam.model.constants import ArmConstants, Array
from wam.model.friction import MotorFriction, largest_motor_ratios

LARGEST_RESIDUAL = 0.2  # of Coulomb friction, rms on the held-out path
LEAST_BOUND = 0.7  # lower bound as a share of the estimate
_STRIBECK = np.geomspace(0.005, 0.08, 13)  # rad/s of the joint
_EXCESS = np.linspace(0.0, 0.7, 15)  # s - 1
_SIGMAS = 1.96
_LOAD = 0.03  # N m per N m; this and the next two: standard deviations of priors
_RIPPLE = 0.1  # of Coulomb friction
_INERTIA = 0.1  # of the model's inertia
_PEAK_WEIGHT = 3.0  # weight of a break-away row relative to a sliding row
_FEWEST_LEGS = 3  # legs with a measured compliance, per motor
_ASSUMED_PRESLIDING, _PRESLIDING = 2e-3, (2e-4, 5e-3)  # rad of the joint
_NOISE = 0.03  # of Coulomb friction: noise floor of a row
_COLUMNS = 7  # F_c, F_a, mu, r_s, r_c, b, inertia; then gravity


@dataclass(frozen=True, slots=True)
class FrictionFit:
    """Identified friction.

    Attributes:
        friction: friction of the motors.
        deviation: standard deviation of the Coulomb torques [N m], shape (7,).
        asymmetry_deviation: standard deviation of the asymmetries [N m], shape (7,).
        residual: rms on the held-out path as shares of Coulomb friction, shape (7,).
        rows: number of rows of each motor, shape (7,).
        moments: correction of the first moments of the subtracted gravity [kg m],
            shape (7, 3).
    """

    friction: MotorFriction
    deviation: Array
    asymmetry_deviation: Array
    residual: Array
    rows: tuple[int, ...]
    moments: Array = field(default_factory=lambda: np.zeros((7, 3)))

    @property
    def lower_bound(self) -> Array:
        """Lower 95 % bound of the motors' Coulomb torques [N m], shape (7,)."""
        return self.friction.coulomb - _SIGMAS * self.deviation

    def residual_friction(self, share: float) -> Array:
        """Return an upper bound of sliding friction after compensation [N m], (7,).

        The upper 95 % bound of friction less the compensated torque.

        Args:
            share: share of the lower bound that float compensates, 0 = none.
        """
        asymmetry = np.abs(self.friction.asymmetry)
        upper_bound = self.friction.coulomb + asymmetry + _SIGMAS * self.deviation
        return upper_bound - share * np.maximum(self.lower_bound - asymmetry, 0.0)


@dataclass(frozen=True, slots=True)
class _MotorFit:
    """Fit of one motor; values as `_columns` orders them."""

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
    """Fit friction to `rows` and validate it on `held_out`.

    Args:
        constants: constants of the arm.
        rows: rows of the seven motors.
        held_out: rows of the seven motors on the held-out path.
        gravity_deviation: standard deviation of the first moments [kg m], shape (21,).

    Raises:
        SettingsError: a motor did not slide enough either way.
    """
    for motor, motor_rows in enumerate(rows, 1):
        check_row_count(motor, motor_rows)
    ratios = largest_motor_ratios(constants)
    fits = [
        _fit_motor(motor_rows, float(scale), gravity_deviation)
        for motor_rows, scale in zip(rows, ratios, strict=True)
    ]
    friction = _friction_of(
        fits, ratios, [motor_rows.compliance for motor_rows in rows]
    )
    residual = _residuals(friction, fits, held_out)
    # Held-out error is systematic: unlike noise, it does not average out.
    systematic = (residual * friction.coulomb)[:, None]
    random = np.sqrt([np.diag(fit.covariance)[:2] for fit in fits])
    deviations = np.hypot(random, systematic)
    return FrictionFit(
        friction=friction,
        deviation=deviations[:, 0],
        asymmetry_deviation=deviations[:, 1],
        residual=residual,
        rows=tuple(len(motor_rows) for motor_rows in rows),
        moments=_moments(rows, fits, gravity_deviation),
    )


def _moments(
    rows: Sequence[SlidingRows], fits: Sequence[_MotorFit], gravity_deviation: Array
) -> Array:
    """Return the common correction of first moments [kg m], shape (7, 3).

    Each motor's own fit has a separate correction; the arm has only one.
    """
    normal = np.diag(1.0 / np.maximum(gravity_deviation, 1e-9) ** 2)
    torques = np.zeros(21)
    for motor_rows, fit in zip(rows, fits, strict=True):
        columns = _columns(motor_rows, fit.stribeck, fit.excess, fit.load_at)
        residuals = motor_rows.friction - columns[:, :_COLUMNS] @ fit.values[:_COLUMNS]
        weights = _weights(motor_rows, float(np.median(np.abs(motor_rows.friction))))
        weighted = motor_rows.gravity * weights[:, None]
        normal += weighted.T @ weighted
        torques += weighted.T @ (residuals * weights)
    return np.asarray(np.linalg.solve(normal, torques), np.float64).reshape(7, 3)


def _friction_of(
    fits: Sequence[_MotorFit], turns: Array, compliances: Sequence[Array]
) -> MotorFriction:
    """Return the fits as a friction model.

    Presliding is the deflection at break-away torque, clipped to a plausible range.
    Motors with too few measured compliances get 2 mrad (ASSUMED).
    """
    values = np.array([fit.values[:_COLUMNS] for fit in fits])
    coulomb = values[:, 0]
    breakaway_torque = coulomb * (1.0 + np.array([fit.excess for fit in fits]))
    medians = [
        float(np.median(compliance)) if len(compliance) >= _FEWEST_LEGS else np.nan
        for compliance in compliances
    ]
    measured = np.clip(np.array(medians) * breakaway_torque / turns, *_PRESLIDING)
    presliding = np.where(np.isnan(measured), _ASSUMED_PRESLIDING, measured)
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
    """Refuse a fit that does not describe the arm.

    Raises:
        SettingsError: large residuals on the held-out path, or a wide interval.
    """
    hint = "The arm must not be touched. Is the gravity model that of this foot?"
    worst = int(fit.residual.argmax())
    if not fit.residual[worst] <= LARGEST_RESIDUAL:
        raise SettingsError(
            f"The friction model does not fit motor {worst + 1}: its residual on the "
            f"held-out path is {fit.residual[worst]:.2f} of Coulomb friction rms "
            f"(limit {LARGEST_RESIDUAL:g}).",
            hint=hint,
        )
    shares = fit.lower_bound / fit.friction.coulomb
    widest = int(shares.argmin())
    if fit.friction.coulomb.min() <= 0.0 or not shares[widest] >= LEAST_BOUND:
        raise SettingsError(
            f"The Coulomb friction of motor {widest + 1} is hardly known: its lower "
            f"bound is {shares[widest]:.2f} of it (at least {LEAST_BOUND:g}).",
            hint=hint,
        )


def _fit_motor(rows: SlidingRows, turns: float, gravity: Array) -> _MotorFit:
    """Fit one motor: a coarse grid search, then a finer one around its optimum."""
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
    """Return (w_s, s - 1) with the least_cost weighted sum of squares on the grid."""
    best, least_cost = (float(stribecks[0]), float(excesses[0])), np.inf
    for stribeck in stribecks.tolist():
        for excess in excesses.tolist():
            A, y, prior = _system(rows, stribeck, excess, load_at, scale, gravity)
            values, _ = _solve(A, y, prior)
            cost = float(((y - A @ values) ** 2).sum() + (prior * values**2).sum())
            if cost < least_cost:
                best, least_cost = (stribeck, excess), cost
    return best


def _system(
    rows: SlidingRows,
    stribeck: float,
    excess: float,
    load_at: float,
    scale: float,
    gravity: Array,
) -> tuple[Array, Array, Array]:
    """Return weighted columns, weighted torques and prior weights of the linear fit.

    Args:
        rows: rows of one motor.
        stribeck: w_s [rad/s].
        excess: s - 1.
        load_at: reference load of Coulomb friction, tau_0 [N m].
        scale: typical friction of the motor [N m].
        gravity: prior standard deviation of each first moment [kg m].
    """
    A = _columns(rows, stribeck, excess, load_at)
    weights = _weights(rows, scale)
    weights *= np.where(rows.speed == 0.0, _PEAK_WEIGHT, 1.0)
    ripple = 1.0 / (_RIPPLE * scale) ** 2
    weak = [0.0, 0.0, 1.0 / _LOAD**2, ripple, ripple, 0.0, 1.0 / _INERTIA**2]
    prior = np.concatenate([weak, 1.0 / np.maximum(gravity, 1e-9) ** 2])
    return A * weights[:, None], rows.friction * weights, prior


def _weights(rows: SlidingRows, scale: float) -> Array:
    """Return the weights of sliding rows [1/(N m)]; `scale`: motor friction [N m]."""
    return 1.0 / np.hypot(_NOISE * scale, _INERTIA * rows.inertia)


def _columns(
    rows: SlidingRows, stribeck: float, excess: float, load_at: float
) -> Array:
    """Return the design matrix, shape (n, 28)."""
    weakening = 1.0 + excess / (1.0 + (rows.speed / stribeck) ** 2)
    signed = rows.sense * weakening
    columns = [
        signed,
        weakening,
        signed * (np.abs(rows.load) - load_at),
        signed * np.sin(rows.angle),
        signed * np.cos(rows.angle),
        rows.speed,
        rows.inertia,
    ]
    return np.column_stack([*columns, rows.gravity])


def _solve(A: Array, y: Array, prior: Array) -> tuple[Array, Array]:
    """Return the parameter values and the normal matrix."""
    normal = A.T @ A + np.diag(prior + 1e-12)
    return np.asarray(np.linalg.solve(normal, A.T @ y), dtype=np.float64), normal


def _sandwich(
    A: Array, residuals: Array, block: NDArray[np.int64], normal: Array
) -> Array:
    """Return the covariance of the values, clustered by block."""
    blocks, block_index = np.unique(block, return_inverse=True)
    scores = np.zeros((len(blocks), A.shape[1]))
    np.add.at(scores, block_index, A * residuals[:, None])
    inverse = np.linalg.inv(normal)
    factor = len(blocks) / max(len(blocks) - 1, 1)
    return factor * inverse @ (scores.T @ scores) @ inverse


def _residuals(
    friction: MotorFriction, fits: Sequence[_MotorFit], rows: Sequence[SlidingRows]
) -> Array:
    """Return the rms residual on `rows` as share of Coulomb friction, shape (7,)."""
    shares: list[float] = []
    for coulomb, fit, motor_rows in zip(friction.coulomb, fits, rows, strict=True):
        A = _columns(motor_rows, fit.stribeck, fit.excess, fit.load_at)
        residuals = motor_rows.friction - A @ fit.values
        shares.append(float(np.sqrt(np.mean(residuals**2)) / coulomb))
    return np.array(shares)
