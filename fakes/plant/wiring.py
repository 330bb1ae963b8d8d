"""Wiring faults between pucks and motors: cables, coils and encoders.

A reversed plug, an open coil or swapped motor cables change the torque of a motor;
swapped encoder cables report the position of another motor.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from wam.model.constants import Array


def _as_built() -> Array:
    return np.eye(7)


@dataclass(frozen=True, slots=True)
class Wiring:
    """Wiring of the seven pucks and motors.

    Attributes:
        torque: motor torques per commanded torque, shape (7, 7).
        counts: encoder counts per motor travel, shape (7, 7).
        home: motor counts at the zero pose, shape (7,).
        torn: motor whose cable to the joints is torn, 1-7; its rotor stays in place
            under the law's spring. 0 = none.
        torn_at: position of that rotor [counts].
        shift: offset of the reported counts, shape (7,).
    """

    torque: Array = field(default_factory=_as_built)
    counts: Array = field(default_factory=_as_built)
    home: Array = field(default_factory=lambda: np.zeros(7))
    torn: int = 0
    torn_at: float = 0.0
    shift: Array = field(default_factory=lambda: np.zeros(7))

    def applied_torques(self, units: Sequence[int]) -> list[int]:
        """Return the motor torques for commanded `units` [puck units], seven."""
        torques = self.torque.dot(np.array(units, dtype=float))
        if self.torn:
            torques[self.torn - 1] = 0.0
        return [round(unit) for unit in torques.tolist()]

    def reported_counts(self, counts: Array) -> Array:
        """Return the reported counts for true motor positions `counts`, shape (7,)."""
        reported = self.home + self.counts.dot(counts - self.home) + self.shift
        if self.torn:
            reported[self.torn - 1] = self.torn_at
        return reported
