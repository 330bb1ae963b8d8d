"""Load on the wrist sensor's gauges: ground, weight and inertia of the foot."""

from collections.abc import Sequence

import numpy as np

from fakes.plant.push import Vector3
from ft_sensor.payload import payload_of
from wam.model.constants import GRAVITY, Array
from wam.model.tool import Tool

Wrench = tuple[float, float, float, float, float, float]


class WristGauges:
    """The load on the sensor between arm and foot, cycle by cycle.

    f = F_c + m (g_w - a)
    n = p_s x F_c + M_c + c x m (g_w - a) - I alpha - w x I w      in the sensor frame

    with F_c and M_c the ground's wrench at the sole p_s, a and alpha the mean
    accelerations of the foot over the cycle; m, c and I of everything below the gauges.

    Attributes:
        cable: force of the sensor's cable on the foot [N], terrain frame, or None.
    """

    def __init__(self, tool: Tool, up: Array, period: float) -> None:
        """Set tool, upward direction in the terrain frame (3,), and cycle time [s]."""
        payload = payload_of(tool)
        turn = payload.rotation
        origin = np.array([0.0, 0.0, tool.sensor_height])
        self._mass, self._sign = payload.mass, payload.sign
        self._sole = _vector(turn.T @ (tool.sole - origin))
        self._com = _vector(payload.com)
        self._com_from_sole = _vector(turn.T @ (tool.foot.com - tool.sole))
        self._inertia = turn.T @ tool.foot.inertia @ turn
        self._mounting = turn
        self._period = period
        self._rotation = np.eye(3)
        self._ground: Sequence[float] = (0.0,) * 6
        self._rates: Sequence[float] = (0.0,) * 6
        self._before: Sequence[float] = (0.0,) * 6
        self._load: Wrench | None = None
        self._up: list[float] = up.tolist()
        self.cable: Array | None = None

    def end_cycle(
        self, rotation: Array, ground: Sequence[float], rates: Sequence[float]
    ) -> None:
        """Set the motion and ground wrench of a cycle.

        Args:
            rotation: frame 7 to terrain, shape (3, 3).
            ground: mean force [N] and moment at the sole [N m], terrain frame.
            rates: linear [m/s] and angular velocity [rad/s] of the sole at its end.
        """
        self._rotation, self._ground = rotation, ground
        self._before, self._rates = self._rates, rates
        self._load = None

    def load(self) -> Wrench:
        """Return the reading of an ideal sensor in its own frame [N, N m]."""
        if self._load is None:
            self._load = self._compute()
        return self._load

    def _compute(self) -> Wrench:
        """Compute the load in Python floats: ten times as fast as numpy for vectors."""
        before, now, period = self._before, self._rates, self._period
        change = [(v - u) / period for u, v in zip(before, now, strict=True)]
        # Rows: force, moment, linear and angular acceleration, angular velocity, up.
        rows = np.array([*self._ground, *change, *now[3:], *self._up]).reshape(6, 3)
        felt = rows.dot(self._rotation.dot(self._mounting))
        force, moment, a, alpha, w, (gx, gy, gz) = felt.tolist()
        # The inertia is symmetric, so row vectors times it are I alpha and I w.
        (ix, iy, iz), (jx, jy, jz) = felt[3:5].dot(self._inertia).tolist()
        spin = _cross(w, (jx, jy, jz))
        euler = _cross(alpha, self._com_from_sole)
        inward = _cross(w, _cross(w, self._com_from_sole))
        lever = _cross(self._sole, force)
        if self.cable is not None:  # acts at the gauges, without a lever arm
            pull = self.cable.dot(self._rotation.dot(self._mounting))
            force = [f + extra for f, extra in zip(force, pull, strict=True)]
        m, s = self._mass, self._sign
        weight = (
            -m * (GRAVITY * gx + a[0] + euler[0] + inward[0]),
            -m * (GRAVITY * gy + a[1] + euler[1] + inward[1]),
            -m * (GRAVITY * gz + a[2] + euler[2] + inward[2]),
        )
        swing = _cross(self._com, weight)
        return (
            s * (force[0] + weight[0]),
            s * (force[1] + weight[1]),
            s * (force[2] + weight[2]),
            s * (moment[0] + lever[0] + swing[0] - ix - spin[0]),
            s * (moment[1] + lever[1] + swing[1] - iy - spin[1]),
            s * (moment[2] + lever[2] + swing[2] - iz - spin[2]),
        )


def _vector(values: Array) -> Vector3:
    x, y, z = values.tolist()
    return x, y, z


def _cross(a: Sequence[float], b: Sequence[float]) -> Vector3:
    ax, ay, az = a
    bx, by, bz = b
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
