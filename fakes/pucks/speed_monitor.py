"""Speed of the arm as the safety module estimates it from bus traffic.

The exact algorithm is not public. Known are two points, the elbow and one on the
forearm, five samples of history, and joint speeds as long as the arm is not zeroed.
"""

from collections import deque
from collections.abc import Mapping, Sequence
from math import hypot, pi, sin

import numpy as np

from wam.model.constants import load_constants

ELBOW = 0.55  # from shoulder to elbow [m]
FOREARM = 0.35  # from the elbow to the point on the forearm [m]
HISTORY = 5  # differences; a position jump affects as many samples
_MAIN_JOINTS = 4  # wrist motion is ignored
_Row = tuple[float, float, float, float]


class SpeedMonitor:
    """Speeds from position reports of motors 1 to 4 with `cts` counts per turn."""

    def __init__(self, cts: Sequence[int]) -> None:
        m2jp = np.linalg.inv(load_constants().j2mp)[:_MAIN_JOINTS, :_MAIN_JOINTS]
        per_count = [2 * pi / (count or 1) for count in cts[:_MAIN_JOINTS]]
        self._joints: list[_Row] = [(*row,) for row in (m2jp * per_count).tolist()]
        self.reset()

    def reset(self) -> None:
        """Clear the history: the pucks have lost their power."""
        # Times [ns] and positions [counts] by motor, oldest first.
        self._samples: list[deque[tuple[int, int]]] = [
            deque(maxlen=HISTORY + 1) for _ in range(_MAIN_JOINTS)
        ]

    def on_positions(self, t_ns: int, positions: Mapping[int, int]) -> None:
        """Add positions [counts] by node, all latched at `t_ns`."""
        for node, samples in enumerate(self._samples, 1):
            counts = positions.get(node)
            if counts is not None and (not samples or t_ns > samples[-1][0]):
                samples.append((t_ns, counts))

    def joint_speed(self) -> float:
        """Return the speed of the fastest of joints 1 to 4 [rad/s]."""
        rates = self._rates()
        return max(abs(_joint(row, rates)) for row in self._joints)

    def tip_speed(self) -> float:
        """Return the speed of the forearm point [m/s], never below the elbow's.

        v_elbow = 0.55 m hypot(qd2, qd1 sin q2), v_forearm = v_elbow + 0.35 m |qd4|
        (estimate in CMU's driver for the same arm).
        """
        row1, row2, _, row4 = self._joints
        rates = self._rates()
        qd1, qd2, qd4 = _joint(row1, rates), _joint(row2, rates), _joint(row4, rates)
        positions = [samples[-1][1] if samples else 0 for samples in self._samples]
        q2 = _joint(row2, positions)
        return ELBOW * hypot(qd2, qd1 * sin(q2)) + FOREARM * abs(qd4)

    def _rates(self) -> list[float]:
        """Return motor speeds [counts/s] over the history, 0 without one."""
        rates: list[float] = []
        for samples in self._samples:
            if len(samples) < 2:
                rates.append(0.0)
                continue
            (since_ns, first), (t_ns, last) = samples[0], samples[-1]
            rates.append((last - first) / ((t_ns - since_ns) * 1e-9))
        return rates


def _joint(row: _Row, motors: Sequence[float]) -> float:
    """Return one joint's value from motors 1 to 4; unrolled, as it runs every cycle."""
    a, b, c, d = row
    m1, m2, m3, m4 = motors
    return a * m1 + b * m2 + c * m3 + d * m4
