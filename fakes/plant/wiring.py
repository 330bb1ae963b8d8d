"""Between pucks and motors: cables, coils and encoders that are not as built.

A motor whose plug is turned, whose coil is open or which has another puck's cable does
something else with a torque than its puck believes; an encoder's cable on another puck
tells of another motor.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from wam.model.constants import Array


def _as_built() -> Array:
    return np.eye(7)


@dataclass(frozen=True, slots=True)
class Wiring:
    """What passes between the seven pucks and the seven motors.

    Attributes:
        torque: what each motor makes of each torque that is sent, shape (7, 7).
        counts: what each encoder tells of each motor's way, shape (7, 7).
        home: counts of the motors where the arm was zeroed, shape (7,).
        torn: motor whose cable to the joints is torn, 1-7: its rotor alone turns, and
            under the law's spring stays where it is. 0 = none.
        torn_at: where that rotor stands [counts].
        shift: counts that are told too much, shape (7,).
    """

    torque: Array = field(default_factory=_as_built)
    counts: Array = field(default_factory=_as_built)
    home: Array = field(default_factory=lambda: np.zeros(7))
    torn: int = 0
    torn_at: float = 0.0
    shift: Array = field(default_factory=lambda: np.zeros(7))

    def made_of(self, units: Sequence[int]) -> list[int]:
        """Return the torques [puck units] that the motors make, shape (7,)."""
        made = self.torque.dot(np.array(units, dtype=float))
        if self.torn:
            made[self.torn - 1] = 0.0
        return [round(unit) for unit in made.tolist()]

    def told_of(self, counts: Array) -> Array:
        """Return what the encoders tell where the motors have turned by `counts`."""
        told = self.home + self.counts.dot(counts - self.home) + self.shift
        if self.torn:
            told[self.torn - 1] = self.torn_at
        return told
