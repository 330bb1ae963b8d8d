"""What the gauges in the wrist feel: ground, weight and inertia of the foot."""

from collections.abc import Sequence

import numpy as np

from ft_sensor.payload import cross_matrix, payload_of
from wam.constants import GRAVITY, Array
from wam.tool import Tool

Wrench = tuple[float, float, float, float, float, float]


class Wrist:
    """The load on the sensor between arm and foot, cycle by cycle.

    f = F_c + m (g_w - a)
    n = p_s x F_c + M_c + c x m (g_w - a) - I alpha - w x I w      in the sensor frame

    with F_c and M_c the ground's at the sole p_s, a and alpha the mean accelerations of
    the foot over the cycle, m, c and I those of everything below the gauges.
    """

    def __init__(self, tool: Tool, axes: Array, period: float) -> None:
        """Take the tool, the terrain's axes as rows (3, 3) and the cycle [s]."""
        self._payload = payload = payload_of(tool)
        origin = np.array([0.0, 0.0, tool.sensor_height])
        self._sole_cross = cross_matrix(payload.rotation.T @ (tool.sole - origin))
        self._com_cross = cross_matrix(payload.com)
        self._com_from_sole = payload.rotation.T @ (tool.foot.com - tool.sole)
        self._inertia = payload.rotation.T @ tool.foot.inertia @ payload.rotation
        self._axes = axes
        self._period = period
        self._rotation = np.eye(3)
        self._ground: Sequence[float] = (0.0,) * 6
        self._rates: Sequence[float] = (0.0,) * 6
        self._before: Sequence[float] = (0.0,) * 6
        self._load: Wrench | None = None

    def end_cycle(
        self, rotation: Array, ground: Sequence[float], rates: Sequence[float]
    ) -> None:
        """Take what happened in a cycle.

        Args:
            rotation: frame 7 to base, shape (3, 3).
            ground: mean force [N] and moment at the sole [N m], terrain frame.
            rates: velocity of the sole [m/s] and turning rate [rad/s] at its end.
        """
        self._rotation, self._ground = rotation, ground
        self._before, self._rates = self._rates, rates
        self._load = None

    def load(self) -> Wrench:
        """Return what the sensor would read without errors, its own frame [N, N m]."""
        if self._load is None:
            self._load = self._compute()
        return self._load

    def _compute(self) -> Wrench:
        payload = self._payload
        to_sensor = (self._rotation @ payload.rotation).T
        change = np.subtract(self._rates, self._before) / self._period
        felt = np.concatenate((self._ground, change, self._rates)).reshape(6, 3)
        force, moment, a, alpha, _, w = felt @ (to_sensor @ self._axes.T).T
        turn, turn_rate = cross_matrix(w), cross_matrix(alpha)
        a = a + (turn_rate + turn @ turn) @ self._com_from_sole
        weight = payload.mass * (-GRAVITY * to_sensor[:, 2] - a)
        inertia = self._inertia
        moment = moment + self._sole_cross @ force + self._com_cross @ weight
        moment = moment - inertia @ alpha - turn @ inertia @ w
        fx, fy, fz = (payload.sign * (force + weight)).tolist()
        tx, ty, tz = (payload.sign * moment).tolist()
        return fx, fy, fz, tx, ty, tz
