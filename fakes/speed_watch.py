"""How fast the arm moves, as a safety module sees it on the bus.

The exact algorithm is Barrett's secret. Known are two points, the elbow and one on the
forearm, five samples of history, and joint speeds as long as the arm is not zeroed.
"""

from collections import deque
from collections.abc import Mapping, Sequence
from math import hypot, pi, sin

import numpy as np

from wam.transmission import coupled_ratios

ELBOW = 0.55  # from shoulder to elbow [m]
FOREARM = 0.35  # from the elbow to the point on the forearm [m]
HISTORY = 5  # differences; a jump of a position is seen in as many samples
_MAIN_JOINTS = 4  # wrist motion is not counted
_RATIOS = (42.0, 28.25, 28.25, 18.0, 9.7, 9.7, 14.93)


class SpeedWatch:
    """Speeds out of position reports of motors 1 to 4 with `cts` counts per turn."""

    def __init__(self, cts: Sequence[int]) -> None:
        m2jp = np.linalg.inv(coupled_ratios(_RATIOS))[:_MAIN_JOINTS, :_MAIN_JOINTS]
        per_count = [2 * pi / (count or 1) for count in cts[:_MAIN_JOINTS]]
        self._joints: list[list[float]] = (m2jp * per_count).tolist()
        self._seen: list[deque[tuple[int, int]]] = [
            deque(maxlen=HISTORY + 1) for _ in range(_MAIN_JOINTS)
        ]

    def forget(self) -> None:
        """Begin anew: the pucks have lost their power."""
        for seen in self._seen:
            seen.clear()

    def hear(self, t_ns: int, positions: Mapping[int, int]) -> None:
        """Take positions [counts] by node, all latched at `t_ns`."""
        for node, counts in positions.items():
            if node <= _MAIN_JOINTS:
                seen = self._seen[node - 1]
                if not seen or t_ns > seen[-1][0]:
                    seen.append((t_ns, counts))

    def joint_speed(self) -> float:
        """Return the speed of the fastest of joints 1 to 4 [rad/s]."""
        return max(map(abs, self._of_joints(self._rates())))

    def tip_speed(self) -> float:
        """Return the larger speed of elbow and forearm point [m/s].

        v_elbow = 0.55 m hypot(qd2, qd1 sin q2), v_forearm = v_elbow + 0.35 m |qd4|:
        the estimate of CMU's driver for the same arm.
        """
        qd1, qd2, _, qd4 = self._of_joints(self._rates())
        q2 = self._of_joints([seen[-1][1] if seen else 0 for seen in self._seen])[1]
        return ELBOW * hypot(qd2, qd1 * sin(q2)) + FOREARM * abs(qd4)

    def _rates(self) -> list[float]:
        """Return motor speeds [counts/s] over the history, 0 where there is none."""
        rates: list[float] = []
        for seen in self._seen:
            elapsed = (seen[-1][0] - seen[0][0]) * 1e-9 if seen else 0.0
            rates.append((seen[-1][1] - seen[0][1]) / elapsed if elapsed else 0.0)
        return rates

    def _of_joints(self, motors: Sequence[float]) -> list[float]:
        return [
            sum(ratio * motor for ratio, motor in zip(row, motors, strict=True))
            for row in self._joints
        ]
