"""Friction of the simulated arm: parameter table, random draw, and bristle model.

Only Coulomb and viscous friction of one WAM are published. All other values are
ASSUMED, with the range from which those of a simulated arm are drawn.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acquisition.clock import PERIOD_NS
from fakes.randomness import friction_generator
from wam.model.constants import ArmConstants, Array
from wam.model.friction import (
    ELASTIC,
    MotorFriction,
    largest_motor_ratios,
    motor_shares,
    plastic_share,
)

ASSUMED = "ASSUMED"  # not measured on any WAM


@dataclass(frozen=True, slots=True)
class FrictionParameter:
    """One row of the table.

    Attributes:
        name: name of the parameter.
        unit: unit.
        nominal: value without a seed.
        low: smallest value drawn.
        high: largest value drawn.
        source: source; `ASSUMED` = not measured on any WAM.
    """

    name: str
    unit: str
    nominal: float
    low: float
    high: float
    source: str

    def values(self, random: np.random.Generator | None) -> Array:
        """Return one value for each motor, shape (7,); without `random`, nominal."""
        if random is None:
            return np.full(7, self.nominal)
        return random.uniform(self.low, self.high, 7)


_OWD = "Coulomb and viscous of one arm (OWD, wam7.toml); spread ASSUMED"
FRICTION_TABLE = (
    FrictionParameter("coulomb", "of wam7.toml", 1.0, 0.8, 1.2, _OWD),
    FrictionParameter("viscous", "of wam7.toml", 1.0, 0.5, 1.5, _OWD),
    FrictionParameter("asymmetry", "of Coulomb", 0.0, -0.1, 0.1, ASSUMED),
    FrictionParameter("load", "N m per N m", 0.0, 0.0, 0.04, ASSUMED),
    FrictionParameter("breakaway", "of sliding", 1.2, 1.05, 1.4, ASSUMED),
    FrictionParameter("stribeck", "rad/s at the joint", 0.02, 0.01, 0.04, ASSUMED),
    FrictionParameter("ripple", "of Coulomb", 0.0, 0.0, 0.08, ASSUMED),
    FrictionParameter("phase", "rad of the motor", 0.0, -np.pi, np.pi, ASSUMED),
    FrictionParameter("presliding_arm", "rad, motors 1-4", 1e-3, 5e-4, 1.5e-3, ASSUMED),
    FrictionParameter(
        "presliding_wrist", "rad, motors 5-7", 2e-3, 1e-3, 2.5e-3, ASSUMED
    ),
)
# Above 1.5 times the nominal friction a move reports the motor as stuck.
_LARGEST_BREAKAWAY = 1.4
_DAMPED = 1.4  # twice the damping ratio of a bristle
_LIVELY = 0.1  # of the sliding deflection per cycle: then updated in every step
_PERIOD = PERIOD_NS * 1e-9  # s
_LEAST = 1e-9  # N m at a motor: least Coulomb friction, avoids a division by zero


def draw_friction(
    constants: ArmConstants, share: float, seed: int | None, load_at: Array
) -> MotorFriction:
    """Draw the friction of a simulated arm.

    Args:
        constants: constants of the arm, with the friction identified on another arm.
        share: factor of that friction.
        seed: seed of the draw; None = nominal parameters.
        load_at: reference loads of the motors [N m], shape (7,).
    """
    random = None if seed is None else friction_generator(seed)
    drawn = {row.name: row.values(random) for row in FRICTION_TABLE}
    nominal = share * motor_shares(constants, constants.coulomb, 1)
    viscous = share * motor_shares(constants, constants.viscous, 2)
    coulomb = nominal * drawn["coulomb"]
    largest_factor = drawn["coulomb"] * (1.0 + np.abs(drawn["asymmetry"]))
    turns = largest_motor_ratios(constants)
    presliding = np.append(drawn["presliding_arm"][:4], drawn["presliding_wrist"][4:])
    ripple, phase = drawn["ripple"], drawn["phase"]
    return MotorFriction(
        coulomb=np.maximum(coulomb, _LEAST),
        asymmetry=coulomb * drawn["asymmetry"],
        load=share * drawn["load"],
        load_at=load_at,
        breakaway=np.minimum(drawn["breakaway"], _LARGEST_BREAKAWAY / largest_factor),
        stribeck=turns * drawn["stribeck"],
        viscous=viscous * drawn["viscous"],
        ripple_sin=ripple * np.cos(phase),
        ripple_cos=ripple * np.sin(phase),
        presliding=turns * presliding,
    )


class BristleFriction:
    """Friction of the seven motors: one elasto-plastic bristle each.

    Implicit in the speed: over a step dt the torque against the motion is c z + D w,
    with w the speed at its end, and z <- a (z + dt w). With s0 = g at standstill /
    presliding, s1 the damping of the bristle and b that of the motor,

        a = 1 / (1 + dt alpha s0 |w| / g),  D = a (s0 dt + s1) + b
        c = a (s0 + s1 / dt) - s1 / dt

    c, D and a are updated in every cycle, and in every step if a motor moves a tenth of
    its presliding in a cycle. They are never negative, so the bristles only store or
    dissipate energy, whenever they are updated.

    Attributes:
        damping: D of the seven motors [N m s/rad].
    """

    def __init__(self, friction: MotorFriction, inertia: Array, dt: float) -> None:
        """Start with relaxed bristles.

        Args:
            friction: friction of the motors.
            inertia: effective inertia at each motor [kg m^2], shape (7,).
            dt: length of a step [s].
        """
        self._dt = dt
        self._columns = columns = bristle_columns(friction, inertia, dt)
        self._bent_springs = [s0 for _, _, s0, _, _, _, _ in columns]
        self._bent_damping = [bent + b for _, _, _, bent, _, _, b in columns]
        self._lively: list[float] = fine_step_speeds(friction).tolist()
        load_and_ripple = np.stack(
            (
                friction.coulomb - friction.load * friction.load_at,
                friction.load,
                friction.asymmetry,
                friction.ripple_sin,
                friction.ripple_cos,
            ),
            axis=-1,
        )
        self._levels: list[list[float]] = load_and_ripple.tolist()
        self.update_load([0.0] * 7, [0.0] * 7)
        self.rest()

    def rest(self) -> None:
        """Relax the bristles, as in a supported arm."""
        self._z = [0.0] * 7
        self._keep = [1.0] * 7
        self.take([0.0] * 7)

    def update_load(self, angles: Sequence[float], tau: Sequence[float]) -> None:
        """Update the dry friction at the present angles and loads.

        Args:
            angles: motor angles [rad].
            tau: load torques of the motors [N m].
        """
        levels: list[tuple[float, float]] = []
        for angle, torque, row in zip(angles, tau, self._levels, strict=True):
            coulomb, load, asymmetry, ripple_sin, ripple_cos = row
            level = coulomb + load * abs(torque)
            ripple = 1.0 + ripple_sin * math.sin(angle) + ripple_cos * math.cos(angle)
            levels.append(((level + asymmetry) * ripple, (level - asymmetry) * ripple))
        self._sliding_torques = levels

    def follow(self, speeds: Sequence[float]) -> None:
        """Advance the bristles by a step at motor speeds `speeds` [rad/s]."""
        dt = self._dt
        state = zip(self._keep, self._z, speeds, strict=True)
        self._z = [keep * (z + dt * w) for keep, z, w in state]

    def needs_fine_steps(self, speeds: Sequence[float]) -> bool:
        """Return whether a motor is fast enough for updates in every step."""
        state = zip(speeds, self._lively, strict=True)
        return any(abs(speed) > limit for speed, limit in state)

    def take(self, speeds: Sequence[float]) -> None:
        """Update c, D and a at motor speeds `speeds` [rad/s]."""
        dt = self._dt
        keeps, dampings = [1.0] * 7, self._bent_damping.copy()
        springs = self._bent_springs.copy()
        state = zip(speeds, self._z, self._sliding_torques, self._columns, strict=True)
        for i, (w, z, (forward, backward), row) in enumerate(state):
            if z * w <= 0.0:
                continue
            more, slow, s0, bent_damping, bent_spring, s1_dt, b = row
            x = w * slow
            # Deflection and speed have the same sign here: use magnitudes.
            speed, bend, g = (w, z, forward) if w > 0.0 else (-w, -z, backward)
            g *= 1.0 + more / (1.0 + x * x)
            bent = bend * s0 / g
            if bent > ELASTIC:
                rate = plastic_share(bent) * s0 * speed / g
                keeps[i] = keep = 1.0 / (1.0 + dt * rate)
                dampings[i] = keep * bent_damping + b
                springs[i] = keep * bent_spring - s1_dt
        self._keep, self.damping, self._springs = keeps, dampings, springs

    def torques(self, speeds: Sequence[float]) -> list[float]:
        """Return the friction torques on the motors [N m] at `speeds` [rad/s]."""
        state = zip(self._springs, self._z, self.damping, speeds, strict=True)
        return [-c * z - d * w for c, z, d, w in state]


def fine_step_speeds(friction: MotorFriction) -> Array:
    """Return the speed limits for updates once per cycle [rad/s], shape (7,)."""
    return _LIVELY / _PERIOD * friction.presliding


def bristle_columns(
    friction: MotorFriction, inertia: Array, dt: float
) -> list[list[float]]:
    """Return the coefficients of `BristleFriction.take`, seven per motor.

    s - 1, 1 / w_s, s0, s0 dt + s1, s0 + s1 / dt, s1 / dt, b.
    """
    s0 = friction.coulomb * friction.breakaway / friction.presliding
    s1 = _DAMPED * np.sqrt(s0 * inertia)
    columns = (
        friction.breakaway - 1.0,
        1.0 / friction.stribeck,
        s0,
        s0 * dt + s1,
        s0 + s1 / dt,
        s1 / dt,
        friction.viscous,
    )
    return np.stack(columns, axis=-1).tolist()
