"""What acts on the joints in a substep: one buffer, one product."""

from collections.abc import Sequence
from struct import Struct

import numpy as np

from wam.model.constants import Array

_LAYOUT = Struct("26d")  # wrench on foot and hand, joint velocities, driving torques


class JointLoads:
    """Turns wrenches on foot and hand, motion and torques into torques of the joints.

    Attributes:
        A: rows that give the sole's velocity, the foot's turn, the hand's velocity and
            turn from the joint velocities, shape (12, 7); to be filled in place.
    """

    def __init__(self) -> None:
        self._B = np.vstack((np.zeros((12, 7)), np.zeros((7, 7)), np.eye(7)))
        self.A = self._B[:12]
        self._resisting = self._B[12:19].reshape(-1)[:: 7 + 1]  # the diagonal of -D
        self._buffer = bytearray(_LAYOUT.size)
        self._loads = np.frombuffer(self._buffer)

    def resist(self, damping: Sequence[float]) -> None:
        """Let the joints be damped by `damping` [N m s/rad], seven, from now on."""
        np.negative(damping, out=self._resisting)

    def torques(
        self,
        wrench: Sequence[float],
        qd: Sequence[float],
        driving: Sequence[float],
    ) -> Array:
        """Return A^T `wrench` - D `qd` + `driving` [N m], shape (7,).

        Args:
            wrench: on foot and hand, twelve numbers in the order of the rows of A.
            qd: joint velocities [rad/s], seven.
            driving: torques that drive the joints [N m], seven.
        """
        _LAYOUT.pack_into(self._buffer, 0, *wrench, *qd, *driving)
        return self._loads.dot(self._B)
