# pyright: basic
"""What the gauges in the wrist feel, by the equations of `fakes.plant.gauges`."""

from collections.abc import Sequence
from struct import Struct

import numpy as np

from fakes.kernels.compiler import inline, kernel
from fakes.plant.gauges import Wrench, WristGauges
from wam.model.constants import GRAVITY, Array
from wam.model.tool import Tool

_TAKEN = Struct("12d")
# Force and moment of the ground, rates of the foot now and before, what is up; in the
# frame of the sensor: force and moment, accelerations, rates now, what is up.
_GAUGES = np.dtype(
    [
        ("taken", float, (7, 3)),
        ("felt", float, (7, 3)),
        ("shown", float, (6,)),
        ("turn", float, (3, 3)),
        ("inertia", float, (3, 3)),
        ("sole", float, (3,)),
        ("com", float, (3,)),
        ("com_from_sole", float, (3,)),
        ("mass", float),
        ("sign", float),
        ("period", float),
    ],
    align=True,
)


class CompiledGauges(WristGauges):
    """The load on the sensor between arm and foot, cycle by cycle."""

    def __init__(self, tool: Tool, up: Array, period: float) -> None:
        """Take the tool, what is up in the terrain frame, (3,), and the cycle [s]."""
        super().__init__(tool, up, period)
        self._bytes = bytearray(_GAUGES.itemsize)  # `taken` is what comes first
        self._records = records = np.frombuffer(self._bytes, _GAUGES)
        records["taken"][0, 6] = up
        names = ("turn", "inertia", "sole", "com", "com_from_sole", "mass", "sign")
        for name in (*names, "period"):
            records[name][0] = getattr(self, f"_{name}")
        self._shown = records["shown"][0]

    def end_cycle(
        self, rotation: Array, ground: Sequence[float], rates: Sequence[float]
    ) -> None:
        """Take what happened in a cycle; see `WristGauges.end_cycle`."""
        _TAKEN.pack_into(self._bytes, 0, *ground, *rates)
        _feel(self._records, rotation)
        self._load = None

    def _compute(self) -> Wrench:
        fx, fy, fz, tx, ty, tz = self._shown.tolist()
        return fx, fy, fz, tx, ty, tz


@inline
def _cross(a, b):
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@kernel
def _feel(records, rotation):
    """Fill `shown` with the load in the frame of the sensor [N, N m]."""
    g = records[0]
    for k in range(3):
        for i in (2, 3):
            g.felt[i, k] = (g.taken[i, k] - g.taken[i + 2, k]) / g.period
            g.felt[i + 2, k] = g.taken[i + 2, k] = g.taken[i, k]
        for i in (0, 1, 6):
            g.felt[i, k] = g.taken[i, k]
    for i in range(7):
        x, y, z = g.felt[i, 0], g.felt[i, 1], g.felt[i, 2]
        for k in range(3):
            g.felt[i, k] = 0.0
            for j in range(3):
                along = x * rotation[0, j] + y * rotation[1, j] + z * rotation[2, j]
                g.felt[i, k] += along * g.turn[j, k]
    force, moment, a, alpha = g.felt[0], g.felt[1], g.felt[2], g.felt[3]
    w, up, shown, s = g.felt[5], g.felt[6], g.shown, g.sign
    euler = _cross(alpha, g.com_from_sole)
    inward = _cross(w, _cross(w, g.com_from_sole))
    spin = _cross(w, _turned(g.inertia, w))
    slow = _turned(g.inertia, alpha)
    for k in range(3):
        weight = -g.mass * (GRAVITY * up[k] + a[k] + euler[k] + inward[k])
        shown[3 + k] = weight
        shown[k] = s * (force[k] + weight)
    of_ground = _cross(g.sole, force)
    of_weight = _cross(g.com, shown[3:])
    for k in range(3):
        of_forces = moment[k] + of_ground[k] + of_weight[k]
        shown[3 + k] = s * (of_forces - slow[k] - spin[k])


@inline
def _turned(inertia, w):
    return (
        inertia[0, 0] * w[0] + inertia[0, 1] * w[1] + inertia[0, 2] * w[2],
        inertia[1, 0] * w[0] + inertia[1, 1] * w[1] + inertia[1, 2] * w[2],
        inertia[2, 0] * w[0] + inertia[2, 1] * w[1] + inertia[2, 2] * w[2],
    )
