"""How fast the arm moves, as a safety module sees it on the bus.

The exact algorithm is Barrett's secret. Known are two points, the elbow and one on the
forearm, five samples of history, and joint speeds as long as the arm is not zeroed.
"""

from collections import deque
from collections.abc import Mapping, Sequence
from math import hypot, pi, sin

import numpy as np

from wam.model.constants import load_constants

ELBOW = 0.55  # from shoulder to elbow [m]
FOREARM = 0.35  # from the elbow to the point on the forearm [m]
HISTORY = 5  # differences; a jump of a position is seen in as many samples
_MAIN_JOINTS = 4  # wrist motion is not counted
_Row = tuple[float, float, float, float]


class SpeedMonitor:
    """Speeds out of position reports of motors 1 to 4 with `cts` counts per turn."""

    def __init__(self, cts: Sequence[int]) -> None:
        m2jp = np.linalg.inv(load_constants().j2mp)[:_MAIN_JOINTS, :_MAIN_JOINTS]
        per_count = [2 * pi / (count or 1) for count in cts[:_MAIN_JOINTS]]
        self._joints: list[_Row] = [(*row,) for row in (m2jp * per_count).tolist()]
        self.reset()

    def reset(self) -> None:
        """Begin anew: the pucks have lost their power."""
        # Times [ns] and positions [counts] by motor, oldest first.
        self._seen: list[deque[tuple[int, int]]] = [
            deque(maxlen=HISTORY + 1) for _ in range(_MAIN_JOINTS)
        ]

    def on_positions(self, t_ns: int, positions: Mapping[int, int]) -> None:
        """Take positions [counts] by node, all latched at `t_ns`."""
        for node, seen in enumerate(self._seen, 1):
            counts = positions.get(node)
            if counts is not None and (not seen or t_ns > seen[-1][0]):
                seen.append((t_ns, counts))

    def joint_speed(self) -> float:
        """Return the speed of the fastest of joints 1 to 4 [rad/s]."""
        rates = self._rates()
        return max(abs(_joint(row, rates)) for row in self._joints)

    def tip_speed(self) -> float:
        """Return the larger speed of elbow and forearm point [m/s].

        v_elbow = 0.55 m hypot(qd2, qd1 sin q2), v_forearm = v_elbow + 0.35 m |qd4|:
        the estimate of CMU's driver for the same arm.
        """
        row1, row2, _, row4 = self._joints
        rates = self._rates()
        qd1, qd2, qd4 = _joint(row1, rates), _joint(row2, rates), _joint(row4, rates)
        q2 = _joint(row2, [seen[-1][1] if seen else 0 for seen in self._seen])
        return ELBOW * hypot(qd2, qd1 * sin(q2)) + FOREARM * abs(qd4)

    def _rates(self) -> list[float]:
        """Return motor speeds [counts/s] over the history, 0 where there is none."""
        rates: list[float] = []
        for seen in self._seen:
            if len(seen) < 2:
                rates.append(0.0)
                continue
            (since_ns, first), (t_ns, last) = seen[0], seen[-1]
            rates.append((last - first) / ((t_ns - since_ns) * 1e-9))
        return rates


def _joint(row: _Row, motors: Sequence[float]) -> float:
    """Return what `motors` make of one joint; written out, it is asked every cycle."""
    a, b, c, d = row
    m1, m2, m3, m4 = motors
    return a * m1 + b * m2 + c * m3 + d * m4
