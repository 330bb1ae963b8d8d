"""Positions and velocities of the joints out of the replies of seven motors."""

from collections.abc import Sequence

import numpy as np

from acquisition import Vector
from wam.driver.settings import ArmSettings
from wam.driver.transmission import MOTORS, Transmission

_LONGEST_GUESS = 0.05  # s; beyond, a silent joint is taken to stand still
_PAUSE = 0.1  # s without any reading; positions may then be anywhere


class JointEstimator:
    """Positions and velocities of one arm out of replies that may be missing.

    Velocities are differences over the time between the requests that were answered,
    low-passed by `y += (x - y) wT / (1 + wT)` (backward Euler, as in libbarrett).
    The filter runs on motor rates: it is linear, so joints see the same.

    Attributes:
        transmission: between the motors and the joints.
        counts: last accepted position of each motor [encoder counts].
        q: joint positions [rad], shape (7,); extrapolated where a reply is missing.
        qd: filtered joint velocities [rad/s], shape (7,).
        qd7_raw: unfiltered one-cycle difference of joint 7 [rad/s].
    """

    def __init__(self, transmission: Transmission, settings: ArmSettings) -> None:
        self.transmission = transmission
        self._pole = settings.velocity_pole
        self._jump = settings.jump_counts
        self.begin(0, [0] * MOTORS)

    def begin(self, t_ns: int, counts: Sequence[int]) -> None:
        """Start at `counts` with velocity zero."""
        self.counts = list(counts)
        self.q = self.transmission.joints(counts)
        self.qd: Vector = np.zeros(MOTORS)
        self.qd7_raw = 0.0
        self._positions = [float(c) for c in counts]
        self._rates = [0.0] * MOTORS
        self._times_ns = [t_ns] * MOTORS
        self._t_ns = t_ns

    def update(self, t_ns: int, received: Sequence[int | None]) -> int:
        """Take the replies to the request at `t_ns`; return the bits of the fresh."""
        step = (t_ns - self._t_ns) * 1e-9
        if step <= 0.0:
            step = 1e-9  # asked twice at one instant: no time, no velocity
        share = self._pole * step / (1.0 + self._pole * step)
        is_resumed = step > _PAUSE
        fresh = 0
        times_ns, rates, positions = self._times_ns, self._rates, self._positions
        known, jump = self.counts, self._jump
        for i, counts in enumerate(received):
            elapsed = (t_ns - times_ns[i]) * 1e-9
            last, rate = known[i], rates[i]
            ahead = elapsed if elapsed < _LONGEST_GUESS else _LONGEST_GUESS
            guess = last + rate * ahead
            if counts is None or (
                not -jump <= counts - guess <= jump and not is_resumed
            ):
                positions[i] = guess
                continue
            if elapsed > 0.0:
                rates[i] = rate + share * ((counts - last) / elapsed - rate)
            known[i] = counts
            positions[i] = counts
            times_ns[i] = t_ns
            fresh |= 1 << i
        self._advance(t_ns, step)
        return fresh

    def _advance(self, t_ns: int, step: float) -> None:
        q = self.transmission.joints(self._positions)
        self.qd7_raw = float(q[6] - self.q[6]) / step
        self.q = q
        self.qd = self.transmission.joints(self._rates)
        self._t_ns = t_ns
