"""Contact force from the sensor's reading, slip velocity from the joints.

`LiveFoot` computes them in the loop, the analysis offline with the same functions. With
(f_raw, n_raw) the raw wrench, (b, b_n) its bias, s = +1 or -1 the sign of the sensor,
m_b and c_b mass and centre of mass below the gauges, R_WS the orientation of the sensor
in the base frame and g_w = (0, 0, -g):

    F_c = s (f_raw - b) - m_b R_WS^T g_w        in the sensor frame
    n_c = s (n_raw - b_n) - c_b x m_b R_WS^T g_w

Only `to_base` transforms out of the sensor frame: F = R_WS F_c.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import sqrt
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from acquisition.control_loop.law import FootObserver
from acquisition.devices import ArmReading, WrenchSample
from acquisition.sample import Sample
from wam.model.constants import GRAVITY, Array
from wam.model.tool import Tool

if TYPE_CHECKING:  # slow to import, and most commands do not move an arm
    from wam.model.arm_model import ArmModel

Floats = NDArray[np.float64]


def cross_matrix(a: Array) -> Array:
    """Return the skew-symmetric matrix X of a, X b = a x b, shape (3, 3)."""
    x, y, z = a.tolist()
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


@dataclass(frozen=True, slots=True)
class Payload:
    """Payload and mounting of the sensor.

    Attributes:
        mass: mass of everything below the gauges [kg].
        com: centre of mass in the sensor frame [m], shape (3,).
        rotation: sensor frame to frame 7, shape (3, 3).
        sign: +1 if the sensor reads the load, -1 if it reads the reaction.
        bias: reading without load [N, N m], shape (6,); set by a tare.
    """

    mass: float
    com: Array
    rotation: Array
    sign: float
    bias: Array
    # (3, 6): base z axis in frame 7 -> gravity wrench in the sensor frame.
    _gravity_map: Array = field(init=False, repr=False, compare=False)
    # An array, because numpy takes twice as long to multiply by a Python float.
    _signs: Array = field(init=False, repr=False, compare=False)  # (6,)

    def __post_init__(self) -> None:
        rotated_cross = self.rotation @ cross_matrix(self.com).T
        gravity_map = -self.mass * GRAVITY * np.hstack([self.rotation, rotated_cross])
        object.__setattr__(self, "_gravity_map", gravity_map)
        object.__setattr__(self, "_signs", np.full(6, self.sign))

    def tared(self, reading: Floats, rotation_base_7: Array) -> Payload:
        """Return the payload with the bias from a reading without contact.

        Args:
            reading: mean raw wrench with the foot free [N, N m], shape (6,).
            rotation_base_7: orientation of frame 7 during the reading, shape (3, 3).
        """
        weight = self.weight(rotation_base_7)
        return replace(self, bias=np.asarray(reading) - self.sign * weight)

    def weight(self, rotation_base_7: Floats) -> Floats:
        """Return the payload's gravity wrench in the sensor frame, shape (..., 6).

        Args:
            rotation_base_7: orientation(s) of frame 7, shape (..., 3, 3).
        """
        # The last row of the orientation is the base's z axis in frame 7.
        return rotation_base_7[..., 2, :].dot(self._gravity_map)

    def contact(self, raw: Floats, rotation_base_7: Floats) -> Floats:
        """Return the ground's wrench on the foot in the sensor frame, shape (..., 6).

        Args:
            raw: readings [N, N m], shape (..., 6).
            rotation_base_7: orientation(s) of frame 7, shape (..., 3, 3).
        """
        return self._signs * (raw - self.bias) - self.weight(rotation_base_7)

    def to_base(self, wrench: Floats, rotation_base_7: Floats) -> Floats:
        """Return the force of `wrench` (..., 6) in the base frame, shape (..., 3)."""
        force_7 = wrench[..., :3].dot(self.rotation.T)
        if force_7.ndim == 1:  # live: one reading at a time
            return rotation_base_7.dot(force_7)
        return np.matmul(rotation_base_7, force_7[..., None])[..., 0]


def payload_of(tool: Tool) -> Payload:
    """Return the payload of `tool`, not tared."""
    c, s = np.cos(tool.sensor_angle), np.sin(tool.sensor_angle)
    rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    origin = np.array([0.0, 0.0, tool.sensor_height])
    com = rotation.T @ (tool.foot.com - origin)
    return Payload(tool.foot.mass, com, rotation, tool.sensor_sign, np.zeros(6))


@dataclass(frozen=True, slots=True)
class TerrainFrame:
    """Frame of a terrain: x_T along the push, z_T normal to the plane.

    A push goes toward the base, or away from it in the frame `from_other_end`.

    Attributes:
        incline: angle of the plane [rad]; positive: trials start at the high end.
        heading: direction from the end to the start of a trial about z [rad].
        start: point of the plane where trials start [m], shape (3,), base frame.
        travel: length of a trial along x_T [m].
    """

    incline: float
    heading: float
    start: tuple[float, float, float]
    travel: float

    def axes(self) -> Array:
        """Return the rows x_T, y_T, z_T in the base frame, shape (3, 3)."""
        ca, sa = np.cos(self.incline), np.sin(self.incline)
        ch, sh = np.cos(self.heading), np.sin(self.heading)
        yaw = np.array([[ch, -sh, 0.0], [sh, ch, 0.0], [0.0, 0.0, 1.0]])
        rows = np.array([[-ca, 0.0, -sa], [0.0, -1.0, 0.0], [-sa, 0.0, ca]])
        return rows @ yaw.T

    def from_other_end(self) -> TerrainFrame:
        """Return the frame of a push in the opposite direction, from the other end."""
        end = np.array(self.start) + self.travel * self.axes()[0]
        x, y, z = end.tolist()
        return TerrainFrame(-self.incline, self.heading + np.pi, (x, y, z), self.travel)

    def displacement(self, position: Floats) -> Floats:
        """Return the distance from the start along x_T [m], shape (...)."""
        return (position - np.array(self.start)) @ self.axes()[0]

    def height(self, position: Floats) -> Floats:
        """Return the distance above the plane [m], shape (...)."""
        return (position - np.array(self.start)) @ self.axes()[2]


def traction(axes: Array, velocity: Floats, force: Floats) -> Floats:
    """Return (v_t, F_t, F_n): slip velocity, traction and normal force, (..., 3).

    v_t = v . x_T, F_t = -F . x_T, F_n = F . z_T: all positive in ordinary slip.

    Args:
        axes: rows x_T, y_T, z_T, shape (3, 3).
        velocity: velocity of the sole in the base frame [m/s], shape (..., 3).
        force: ground's force on the foot in the base frame [N], shape (..., 3).
    """
    v_t = velocity @ axes[0]
    return np.stack([v_t, -(force @ axes[0]), force @ axes[2]], axis=-1)


class LiveFoot(FootObserver):
    """Computes foot pose, slip velocity and traction in every cycle."""

    def __init__(
        self, model: ArmModel, payload: Payload, terrain: TerrainFrame
    ) -> None:
        self._model = model
        self.payload = payload
        self._x_T, _, z_T = terrain.axes()
        self._force_axes = np.stack((-self._x_T, z_T))  # F_t = -x_T.F, F_n = z_T.F

    def set_bias(self, bias: Sequence[float]) -> None:
        """Set the tare, taken in `experiments.run.tare`.

        Args:
            bias: the sensor's reading without load [N, N m], six numbers.
        """
        self.payload = replace(self.payload, bias=np.array(bias))

    def observe(
        self, reading: ArmReading, wrench: WrenchSample | None, sample: Sample
    ) -> float:
        """Write foot pose, twist, wrench and traction; return the sole's speed [m/s].

        Without a new wrench the last forces stay in the sample.
        """
        pose, rotation, twist = self._model.sole_motion(reading.q, reading.qd)
        sample.foot_position[...] = pose[:3]
        sample.foot_orientation[...] = pose[3:]
        sample.foot_velocity[...] = twist
        if wrench is not None:
            payload = self.payload
            sample.wrench_raw[...] = wrench.wrench
            contact = payload.contact(sample.wrench_raw, rotation)
            sample.wrench[...] = contact
            force = payload.to_base(contact, rotation)
            sample.traction[1:] = self._force_axes.dot(force)
        velocity = twist[:3]
        sample.traction[0] = self._x_T.dot(velocity)
        return sqrt(velocity.dot(velocity))
