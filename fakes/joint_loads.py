"""What acts on the joints in a substep: one buffer, one product."""

from collections.abc import Sequence
from struct import Struct

import numpy as np

# Wrench on foot and hand, torques that resist and that drive the joints, inertias.
_LAYOUT = Struct("33d")


class JointLoads:
    """Turns wrenches on foot and hand, and torques, into torques of the joints.

    Attributes:
        A: rows that give the sole's velocity, the foot's turn, the hand's velocity and
            turn from the joint velocities, shape (12, 7); to be filled in place.
        inertias: of the drives as they were given last [kg m^2], shape (7,).
    """

    def __init__(self) -> None:
        self._B = np.vstack((np.zeros((12, 7)), np.eye(7), np.eye(7)))
        self.A = self._B[:12]
        self._buffer = bytearray(_LAYOUT.size)
        numbers = np.frombuffer(self._buffer)
        self._loads, self.inertias = numbers[:26], numbers[26:]

    def torques(
        self,
        wrench: Sequence[float],
        torques: tuple[Sequence[float], Sequence[float]],
        inertias: Sequence[float],
    ) -> np.ndarray:
        """Return A^T `wrench` + both `torques` [N m], shape (7,); keep `inertias`.

        Args:
            wrench: on foot and hand, twelve numbers in the order of the rows of A.
            torques: that resist and that drive the joints [N m], seven each.
            inertias: of the drives [kg m^2], seven.
        """
        loads = (*wrench, *torques[0], *torques[1], *inertias)
        _LAYOUT.pack_into(self._buffer, 0, *loads)
        return self._loads.dot(self._B)
