"""Between motor and joint, encoder counts and radians, joint torque and puck units.

The cables couple motors 2 and 3, and 5 and 6: `motor = j2mp @ joint`. Power is kept, so
`tau_motor = inverse(j2mp).T @ tau_joint`. Counts per turn and puck units per N m are
properties of each puck and must be read from it.
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
# The smaller of the cable's limit (MT) and nine tenths of the safety module's warning.
HOST_TORQUE_LIMITS = (4257, 4257, 4257, 4257, 3900, 3900, 1600)

Matrix = NDArray[np.float64]


class TorqueCommand(NamedTuple):
    """Torques for the pucks; a tuple, because it is made in every cycle.

    Attributes:
        units: torque of each motor [puck units], whole numbers.
        tau: joint torques those units make [N m], shape (7,).
        is_clipped: a motor's limit cut the command.
    """

    units: list[int]
    tau: Vector
    is_clipped: bool


@dataclass(frozen=True, slots=True, eq=False)
class Transmission:
    """Cable ratios with the constants of one arm's pucks.

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
        # Power is the same on both sides, tau_m . qd_m = tau_q . qd_q, and with
        # A = j2mp qd_m = A qd_q: so tau_q = A^T tau_m, and tau_m = A^-T tau_q.
        object.__setattr__(self, "j2mp", j2mp)
        object.__setattr__(self, "_joints_of_counts", m2jp / per_rad)
        object.__setattr__(self, "_counts_of_joints", per_rad[:, None] * j2mp)
        object.__setattr__(self, "_units_of_tau", ipnm[:, None] * m2jp.T)
        object.__setattr__(self, "_tau_of_units", j2mp.T / ipnm)

    def joints(self, counts: Sequence[float]) -> Vector:
        """Return joint positions [rad], shape (7,), of motor positions [counts].

        The same line turns count rates [1/s] into joint velocities [rad/s].
        """
        return self._joints_of_counts.dot(counts)

    def exact_counts(self, q: Vector) -> Vector:
        """Return motor positions [counts, not whole], shape (7,), of joints [rad]."""
        return self._counts_of_joints.dot(q)

    def counts(self, q: Vector) -> list[int]:
        """Return motor positions [counts] of joint positions [rad], floored."""
        return [floor(c) for c in self.exact_counts(q).tolist()]

    def fastest_counts(self, qd: Vector) -> Vector:
        """Return count rates [1/s] that joints within ±`qd` [rad/s] cannot exceed."""
        return np.abs(self._counts_of_joints).dot(qd)

    def exact_units(self, tau: Vector) -> Vector:
        """Return motor torques [puck units, not whole] of joint torques [N m]."""
        return self._units_of_tau.dot(tau)

    def tau(self, units: Sequence[float]) -> Vector:
        """Return joint torques [N m], shape (7,), of motor torques [puck units]."""
        return self._tau_of_units.dot(units)

    def command(self, tau: Vector, tau_gravity: Vector) -> TorqueCommand:
        """Return the torques to send for `tau`, within the limits of every motor.

        Where a limit would cut, gravity stays whole and everything else is scaled by
        one factor, so that the arm neither drops nor pulls aside. Rounding comes
        before the wire's floor, which alone would pull the arm down.

        Args:
            tau: joint torques wanted, gravity included [N m], shape (7,).
            tau_gravity: their gravity part [N m], shape (7,).

        Raises:
            DeviceFaultError: a torque is not a number.
        """
        if not isfinite(sum(tau.tolist()) + sum(tau_gravity.tolist())):
            raise DeviceFaultError(
                f"Joint torques are not numbers: {tau.tolist()}.",
                hint="This is an error of the program; nothing was sent.",
            )
        wanted: list[float] = self.exact_units(tau).tolist()
        is_clipped = not are_within(wanted, self.torque_limits)
        if is_clipped:
            gravity: list[float] = self.exact_units(tau_gravity).tolist()
            wanted = keep_gravity(wanted, gravity, self.torque_limits)
        units = [round(unit) for unit in wanted]
        return TorqueCommand(units, self.tau(units), is_clipped)


def keep_gravity(
    wanted: Sequence[float], gravity: Sequence[float], limits: Sequence[float]
) -> list[float]:
    """Return `wanted` cut to ±`limits`, with `gravity` kept and the rest scaled.

    If gravity alone exceeds a limit, that motor gets its limit and nothing else is
    added anywhere. All arguments are in the same unit, one value per motor.
    """
    held = [
        min(max(g, -limit), limit) for g, limit in zip(gravity, limits, strict=True)
    ]
    rest = [unit - g for unit, g in zip(wanted, gravity, strict=True)]
    share = min(
        (
            _room(h, r, limit) / abs(r) if r else inf
            for h, r, limit in zip(held, rest, limits, strict=True)
        ),
    )
    share = min(share, 1.0)
    return [h + share * r for h, r in zip(held, rest, strict=True)]


def _room(held: float, rest: float, limit: float) -> float:
    """Return how far a motor may still go in the direction of `rest`."""
    return max(limit - held if rest > 0 else limit + held, 0.0)


def _check(j2mp: Matrix, constants: tuple[tuple[int, ...], ...]) -> None:
    if j2mp.shape != (MOTORS, MOTORS) or not np.isfinite(j2mp).all():
        raise SettingsError(f"The transmission matrix is {j2mp.shape}, not (7, 7).")
    if abs(np.linalg.det(j2mp)) < 1.0:
        raise SettingsError("The transmission matrix cannot be inverted.")
    for values in constants:
        if len(values) != MOTORS or min(values) <= 0:
            raise SettingsError(f"Seven positive numbers are needed, not {values}.")
