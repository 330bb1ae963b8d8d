"""Impedance at the sole in the terrain frame: what a foot that stands pushes with.

Along x and z either a force is given, against damping alone, or a place, by spring and
damper; y is held on the centre line and the sole parallel to where it was:

    f = F - B v   or   f = clip(K (x_ref - x)) - B v,      tau = J^T [f; m]

Forces grow at bounded rates, references move at bounded speed, so a command that comes
50 times a second is a ramp at 500 Hz. A command that is 0.1 s old asks for no traction
and no way any more; the load stays, or the foot would fall.
"""

from math import isnan, nan

import numpy as np

from acquisition.control_loop.law import SoleGoal
from acquisition.devices import ArmReading
from wam.model.arm_model import ArmModel
from wam.model.constants import Array

# N that may be asked for. At 12 N of traction the wrist is at its torque limit, and
# beyond it the foot would tip over.
LARGEST_F_T, LARGEST_F_N = 11.0, 22.0
TRACTION_RATE, RELEASE_RATE, LOAD_RATE = 20.0, 100.0, 40.0  # N/s: grow, fall; F_n
FASTEST = 0.20  # m/s of a reference
STALE_NS = 100_000_000  # age of a command that asks for nothing more
_DAMPING = 40.0  # N s/m, along a force
_K, _B, _STRONGEST = 400.0, 40.0, 25.0  # to a place: N/m, N s/m, N
# With 100 N s/m the wrist swings at 12 Hz as soon as the foot hangs free.
_DRAWN = 9.0  # N, the spring along x
_LATERAL = 12.0  # N, spring and damper together, along x and y: see above
_TIPPED = 0.1  # rad from where it was, beyond which a foot is pushed no more
_K_ASIDE, _B_ASIDE = 400.0, 40.0  # N/m, N s/m
_K_TURN, _B_TURN = 12.0, 0.8  # N m/rad, N m s/rad
_BEYOND = 0.05  # m past the ends of the container where traction is taken back


class SoleAxes:
    """Forces along x and z of the terrain frame; knows no arm.

    The stance bench steps the same object against the simulated ground alone.

    Attributes:
        is_tipped: the sole is turned too far; nothing pushes it along x any more.
    """

    def __init__(self, travel: float, dt: float) -> None:
        """Ask for nothing yet.

        Args:
            travel: of the container; beyond it no traction is asked for [m].
            dt: period [s].
        """
        self._travel = travel
        self._dt = dt
        self.is_tipped = False
        self.begin(0.0, 0.0, 0)

    def begin(self, x: float, z: float, now_ns: int) -> None:
        """Stay at a place [m] until a goal comes."""
        self._x, self._z = x, z
        self._F_t = self._F_n = 0.0
        self._goal = SoleGoal(nan, nan, x, z, 0.0)
        self._aimed_ns = now_ns

    def aim(self, goal: SoleGoal, x: float, z: float, now_ns: int) -> None:
        """Take a goal; an axis that changes from force to place begins where it is.

        Raises:
            ValueError: a number cannot be obeyed.
        """
        _check(goal)
        before, self._goal, self._aimed_ns = self._goal, goal, now_ns
        if isnan(goal.F_t) and not isnan(before.F_t):
            self._x = x
        if isnan(goal.F_n) and not isnan(before.F_n):
            self._x, self._z = x, z
        if not isnan(goal.F_n) and isnan(before.F_n):
            pressed = _bounded(_K * (z - self._z), _STRONGEST)
            self._F_n = min(max(pressed, 0.0), LARGEST_F_N)
        if not isnan(goal.F_t) and isnan(before.F_t):
            self._F_t = 0.0

    def force(
        self, position: tuple[float, float], speed: tuple[float, float], now_ns: int
    ) -> tuple[float, float]:
        """Return the force on the sole along x and z [N] after one more period.

        Args:
            position: x and z of the sole [m].
            speed: of it along x and z [m/s].
            now_ns: time of the reading [ns].
        """
        goal, (x, z), (vx, vz) = self._goal, position, speed
        is_stale = now_ns - self._aimed_ns > STALE_NS
        step = 0.0 if is_stale else goal.speed * self._dt
        if isnan(goal.F_t):
            self._x = _towards(self._x, goal.x, step)
            most = 0.0 if self.is_tipped else _DRAWN
            spring = _bounded(_K * (self._x - x), most)
            f_x = spring - _B * vx
        else:
            is_inside = -_BEYOND <= x <= self._travel + _BEYOND
            is_allowed = is_inside and not (is_stale or self.is_tipped)
            wanted = goal.F_t if is_allowed else 0.0
            rate = TRACTION_RATE if wanted > self._F_t else RELEASE_RATE
            self._F_t = _towards(self._F_t, wanted, rate * self._dt)
            f_x = self._F_t - _DAMPING * vx
        if isnan(goal.F_n):
            self._z = _towards(self._z, goal.z, step)
            f_z = _bounded(_K * (self._z - z), _STRONGEST) - _B * vz
        else:
            self._F_n = _towards(self._F_n, goal.F_n, LOAD_RATE * self._dt)
            f_z = -self._F_n - _DAMPING * vz
        return _bounded(f_x, _LATERAL), f_z


def _check(goal: SoleGoal) -> None:
    """Refuse what no sole is to do.

    Raises:
        ValueError: a force or speed is out of bounds, or a place is no number.
    """
    forces = ((goal.F_t, LARGEST_F_T), (goal.F_n, LARGEST_F_N))
    if not all(isnan(force) or 0.0 <= force <= most for force, most in forces):
        raise ValueError(f"{goal} asks for a force beyond its bounds")
    if not (abs(goal.x) < 2.0 and abs(goal.z) < 2.0 and 0.0 <= goal.speed <= FASTEST):
        raise ValueError(f"{goal} names no place that the sole can go to")


def _towards(value: float, goal: float, step: float) -> float:
    return min(max(goal, value - step), value + step)


def _bounded(value: float, most: float) -> float:
    return min(max(value, -most), most)


def _turn(rotation: Array, wanted: Array) -> tuple[float, float, float]:
    """Return the small turn from `rotation` to `wanted`, base frame [rad]."""
    (_, xy, xz), (yx, _, yz), (zx, zy, _) = wanted.dot(rotation.T).tolist()
    return 0.5 * (zy - yz), 0.5 * (xz - zx), 0.5 * (yx - xy)


class SoleImpedance:
    """Joint torques of the impedance, for joints 1 to 6; joint 7 has its lock."""

    def __init__(
        self, model: ArmModel, axes: Array, origin: Array, travel: float, dt: float
    ) -> None:
        """Stand on a ground.

        Args:
            model: the arm, for its kinematics.
            axes: x, y, z of the terrain in the base frame as rows, shape (3, 3).
            origin: far end of the container in the base frame [m], shape (3,).
            travel: how long the container is [m].
            dt: period [s].
        """
        self._model = model
        self._axes = axes
        self._origin = origin
        self._along = SoleAxes(travel, dt)
        self._rotation = np.eye(3)

    def begin(self, reading: ArmReading) -> None:
        """Stay where the sole is, parallel to what it is now."""
        position, self._rotation = self._model.sole_pose(reading.q)
        x, _, z = (self._axes @ (position - self._origin)).tolist()
        self._along.begin(x, z, reading.host_ns)

    def aim(self, goal: SoleGoal, reading: ArmReading) -> None:
        """Take a goal.

        Raises:
            ValueError: a number cannot be obeyed.
        """
        position, _ = self._model.sole_pose(reading.q)
        x, _, z = (self._axes @ (position - self._origin)).tolist()
        self._along.aim(goal, x, z, reading.host_ns)

    def torque(self, reading: ArmReading) -> Array:
        """Return joint torques without gravity [N m], shape (7,); 0 at joint 7."""
        axes = self._axes
        position, rotation = self._model.sole_pose(reading.q)
        J = self._model.sole_jacobian(reading.q)
        twist = J.dot(reading.qd)
        x, y, z = axes.dot(position - self._origin).tolist()
        vx, vy, vz = axes.dot(twist[:3]).tolist()
        turned = _turn(rotation, self._rotation)
        self._along.is_tipped = max(map(abs, turned)) > _TIPPED
        f_x, f_z = self._along.force((x, z), (vx, vz), reading.host_ns)
        f_y = _bounded(-_K_ASIDE * y - _B_ASIDE * vy, _LATERAL)
        wrench = np.empty(6)
        wrench[:3] = axes.T.dot((f_x, f_y, f_z))
        wrench[3:] = _K_TURN * np.array(turned) - _B_TURN * twist[3:]
        tau = J.T.dot(wrench)
        tau[6] = 0.0
        return tau
