"""Live view of the foot: pose, wrench and traction written into the sample."""

from collections.abc import Sequence
from dataclasses import replace
from math import sqrt

import numpy as np

from acquisition.devices import ArmReading, WrenchSample
from acquisition.sample import Sample
from ft_sensor.payload import Payload, TerrainFrame
from wam.model.arm_model import ArmModel


class LiveFoot:
    """Foot pose and traction of a sample (implements FootObserver)."""

    def __init__(
        self, model: ArmModel, payload: Payload, terrain: TerrainFrame
    ) -> None:
        self._model = model
        self.payload = payload
        self._x_T, _, z_T = terrain.axes()
        self._of_force = np.stack((-self._x_T, z_T))  # F_t and F_n

    def set_bias(self, bias: Sequence[float]) -> None:
        """Take the sensor's reading without load [N, N m], six numbers."""
        self.payload = replace(self.payload, bias=np.array(bias))

    def observe(
        self, reading: ArmReading, wrench: WrenchSample | None, sample: Sample
    ) -> float:
        """Write foot pose, twist, wrench and traction; return the sole's speed [m/s].

        Without a fresh wrench the last forces are repeated.
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
            sample.traction[1:] = self._of_force.dot(force)
        velocity = twist[:3]
        sample.traction[0] = self._x_T.dot(velocity)
        return sqrt(velocity.dot(velocity))
