"""Joint positions and velocities from the position replies of seven motors."""

from collections.abc import Sequence

import numpy as np

from acquisition.devices import PositionJump, Vector
from wam.driver.settings import ArmSettings
from wam.driver.transmission import MOTORS, Transmission

_LONGEST_EXTRAPOLATION = 0.05  # s of extrapolation; afterwards a silent joint is held
_NOISE_COUNTS = 4  # counts of noise of a motor at rest


class JointEstimator:
    """Position and velocity estimator that tolerates missing replies.

    Velocities are differences over the time between answered requests, low-passed by
    `y += (x - y) wT / (1 + wT)` (backward Euler, as in libbarrett). The filter runs on
    motor rates; it is linear, so the result is the same at the joints.

    A position is accepted within the travel that the joints' speed limits allow since
    the last accepted one, times `jump_margin`: sum_j |j2mp[i, j]| speed[j] counts/rad
    dt. A margin of 2 still lets the guard see a true overspeed, while one false
    position stays below every speed limit in `qd` (the filter passes 0.26 of it per
    cycle). A rejected position leaves its motor at the last accepted one.

    Attributes:
        transmission: transmission between motors and joints.
        counts: last accepted position of each motor [encoder counts].
        q: joint positions [rad], shape (7,); extrapolated where a reply is missing.
        qd: filtered joint velocities [rad/s], shape (7,).
        qd7_raw: unfiltered difference of joint 7 over its last two replies [rad/s]; 0
            after 50 ms of silence and for a rejected position.
        jump: the worst position rejected in the last update, or None.
    """

    def __init__(self, transmission: Transmission, settings: ArmSettings) -> None:
        self.transmission = transmission
        self._pole = settings.velocity_pole
        limits = np.array(settings.speed_limits)
        self._fastest: list[float] = (
            settings.jump_margin * transmission.fastest_counts(limits)
        ).tolist()
        self.begin(0, [0] * MOTORS)

    def begin(self, t_ns: int, counts: Sequence[int]) -> None:
        """Start at `counts` with velocity zero."""
        self.counts = list(counts)
        self.q = self.transmission.joints(counts)
        self.qd: Vector = np.zeros(MOTORS)
        self.qd7_raw = 0.0
        self.jump: PositionJump | None = None
        self._positions = [float(c) for c in counts]
        self._rates = [0.0] * MOTORS
        self._raw_rates = [0.0] * MOTORS
        self._times_ns = [t_ns] * MOTORS
        self._t_ns = t_ns

    def update(self, t_ns: int, received: Sequence[int | None]) -> int:
        """Process the replies to the request at `t_ns`; return the accepted as bits."""
        step = (t_ns - self._t_ns) * 1e-9
        if step <= 0.0:
            step = 1e-9  # two requests at the same time: avoids a division by zero
        share = self._pole * step / (1.0 + self._pole * step)
        fresh = 0
        self.jump = None
        times_ns, rates, positions = self._times_ns, self._rates, self._positions
        accepted, raw_rates = self.counts, self._raw_rates
        rows = zip(received, times_ns, accepted, rates, self._fastest, strict=True)
        for i, (counts, since_ns, last, rate, fastest) in enumerate(rows):
            elapsed = (t_ns - since_ns) * 1e-9
            if counts is None:
                ahead = (
                    elapsed
                    if elapsed < _LONGEST_EXTRAPOLATION
                    else _LONGEST_EXTRAPOLATION
                )
                positions[i] = last + rate * ahead
                if elapsed >= _LONGEST_EXTRAPOLATION:
                    raw_rates[i] = 0.0
                continue
            farthest, travel = fastest * elapsed + _NOISE_COUNTS, counts - last
            if not -farthest <= travel <= farthest:
                positions[i], raw_rates[i] = last, 0.0
                self._note_jump(i, travel, elapsed)
                continue
            if elapsed > 0.0:
                raw_rates[i] = travel / elapsed
                rates[i] = rate + share * (raw_rates[i] - rate)
            accepted[i] = counts
            positions[i] = counts
            times_ns[i] = t_ns
            fresh |= 1 << i
        self._advance(t_ns)
        return fresh

    def _note_jump(self, index: int, counts: int, elapsed: float) -> None:
        """Keep the jump with the highest apparent joint speed."""
        column = self.transmission.joints(
            [counts * (i == index) for i in range(MOTORS)]
        )
        speed = float(np.abs(column).max()) / max(elapsed, 1e-9)
        if self.jump is None or speed > self.jump.speed:
            self.jump = PositionJump(index + 1, counts, speed)

    def _advance(self, t_ns: int) -> None:
        self.q = self.transmission.joints(self._positions)
        self.qd7_raw = float(self.transmission.joints(self._raw_rates)[6])
        self.qd = self.transmission.joints(self._rates)
        self._t_ns = t_ns
