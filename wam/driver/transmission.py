"""Conversion between joints and motors: radians and encoder counts, N m and puck units.

The cables couple motors 2 and 3, and 5 and 6: `motor = j2mp @ joint`. Power is
conserved, so `tau_motor = inverse(j2mp).T @ tau_joint`. Counts per turn and puck units
per N m are properties of each puck and must be read from it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import floor, inf, isfinite, pi
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from acquisition.bounds import are_within
from acquisition.devices import Vector
from acquisition.errors import DeviceFaultError, SettingsError

MOTORS = 7
# Smaller of the cable's limit (MT) and 0.9 of the safety module's warning limit.
HOST_TORQUE_LIMITS = (4257, 4257, 4257, 4257, 3900, 3900, 1600)

Matrix = NDArray[np.float64]


class TorqueCommand(NamedTuple):
    """Torques for the pucks; a tuple for speed, one is made in every cycle.

    Attributes:
        units: motor torques [puck units], integers.
        tau: resulting joint torques [N m], shape (7,).
        is_clipped: a motor's limit reduced the command.
    """

    units: list[int]
    tau: Vector
    is_clipped: bool


@dataclass(frozen=True, slots=True, eq=False)
class Transmission:
    """Cable transmission with the constants of one arm's pucks.

    Attributes:
        j2mp: motor angles from joint angles, shape (7, 7).
        cts: encoder counts per motor turn (CTS), seven of them.
        ipnm: puck torque units per N m at the motor (IPNM), seven of them.
        torque_limits: largest torque the host sends to each motor [puck units].

    Raises:
        SettingsError: the matrix is not an invertible (7, 7), or a constant is missing
            or not positive.
    """

    j2mp: Matrix
    cts: tuple[int, ...]
    ipnm: tuple[int, ...]
    torque_limits: tuple[int, ...] = HOST_TORQUE_LIMITS
    _joints_of_counts: Matrix = field(init=False, repr=False)
    _counts_of_joints: Matrix = field(init=False, repr=False)
    _units_of_tau: Matrix = field(init=False, repr=False)
    _tau_of_units: Matrix = field(init=False, repr=False)

    def __post_init__(self) -> None:
        j2mp = np.array(self.j2mp, dtype=np.float64)
        _check(j2mp, (self.cts, self.ipnm, self.torque_limits))
        m2jp = np.linalg.inv(j2mp)
        per_rad = np.array(self.cts) / (2 * pi)  # counts per rad at the motor
        ipnm = np.array(self.ipnm, dtype=np.float64)  # puck units per N m
        # Power is conserved, tau_m . qd_m = tau_q . qd_q, with qd_m = A qd_q, A = j2mp:
        # so tau_q = A^T tau_m and tau_m = A^-T tau_q.
        object.__setattr__(self, "j2mp", j2mp)
        object.__setattr__(self, "_joints_of_counts", m2jp / per_rad)
        object.__setattr__(self, "_counts_of_joints", per_rad[:, None] * j2mp)
        object.__setattr__(self, "_units_of_tau", ipnm[:, None] * m2jp.T)
        object.__setattr__(self, "_tau_of_units", j2mp.T / ipnm)

    def joints(self, counts: Sequence[float]) -> Vector:
        """Return joint positions [rad], shape (7,), of encoder counts of the motors.

        Also converts count rates [1/s] to joint velocities [rad/s].
        """
        return self._joints_of_counts.dot(counts)

    def exact_counts(self, q: Vector) -> Vector:
        """Return unrounded motor positions [counts], shape (7,), of joints [rad]."""
        return self._counts_of_joints.dot(q)

    def counts(self, q: Vector) -> list[int]:
        """Return motor positions [counts] of joint positions [rad], rounded down."""
        return [floor(c) for c in self.exact_counts(q).tolist()]

    def fastest_counts(self, qd: Vector) -> Vector:
        """Return the largest count rates [1/s] of joint velocities within ±`qd`."""
        return np.abs(self._counts_of_joints).dot(qd)

    def exact_units(self, tau: Vector) -> Vector:
        """Return unrounded motor torques [puck units] of joint torques [N m]."""
        return self._units_of_tau.dot(tau)

    def tau(self, units: Sequence[float]) -> Vector:
        """Return joint torques [N m], shape (7,), of motor torques [puck units]."""
        return self._tau_of_units.dot(units)

    def command(self, tau: Vector, tau_gravity: Vector) -> TorqueCommand:
        """Clip joint torques to the limits of every motor; return the command to send.

        Beyond a limit the gravity part is kept and the remainder scaled by one factor,
        so that the arm neither drops nor changes the direction of its force. Rounding
        to nearest avoids the downward bias of the encoder, which rounds down.

        Args:
            tau: desired joint torques including gravity [N m], shape (7,).
            tau_gravity: their gravity part [N m], shape (7,).

        Raises:
            DeviceFaultError: a torque is not a number.
        """
        if not isfinite(sum(tau.tolist()) + sum(tau_gravity.tolist())):
            raise DeviceFaultError(
                f"Joint torques are not numbers: {tau.tolist()}.",
                hint="This is an error of the program; nothing was sent.",
            )
        exact: list[float] = self.exact_units(tau).tolist()
        is_clipped = not are_within(exact, self.torque_limits)
        if is_clipped:
            gravity: list[float] = self.exact_units(tau_gravity).tolist()
            exact = keep_gravity(exact, gravity, self.torque_limits)
        units = [round(unit) for unit in exact]
        return TorqueCommand(units, self.tau(units), is_clipped)


def keep_gravity(
    wanted: Sequence[float], gravity: Sequence[float], limits: Sequence[float]
) -> list[float]:
    """Return `wanted` limited to ±`limits`, keeping `gravity`, scaling the remainder.

    If gravity alone exceeds a limit, that motor gets its limit and no remainder is
    added to any motor. All arguments are in the same unit, one value per motor.
    """
    kept = [
        min(max(g, -limit), limit) for g, limit in zip(gravity, limits, strict=True)
    ]
    remainder = [unit - g for unit, g in zip(wanted, gravity, strict=True)]
    share = min(
        (
            _headroom(h, r, limit) / abs(r) if r else inf
            for h, r, limit in zip(kept, remainder, limits, strict=True)
        ),
    )
    share = min(share, 1.0)
    return [h + share * r for h, r in zip(kept, remainder, strict=True)]


def _headroom(kept: float, remainder: float, limit: float) -> float:
    """Return the torque left to the limit in the direction of `remainder`."""
    return max(limit - kept if remainder > 0 else limit + kept, 0.0)


def _check(j2mp: Matrix, constants: tuple[tuple[int, ...], ...]) -> None:
    if j2mp.shape != (MOTORS, MOTORS) or not np.isfinite(j2mp).all():
        raise SettingsError(f"The transmission matrix is {j2mp.shape}, not (7, 7).")
    if abs(np.linalg.det(j2mp)) < 1.0:
        raise SettingsError("The transmission matrix cannot be inverted.")
    for values in constants:
        if len(values) != MOTORS or min(values) <= 0:
            raise SettingsError(f"Seven positive numbers are needed, not {values}.")
