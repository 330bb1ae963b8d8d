"""What the gauges of a wrist sensor add to the true load."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fakes.randomness import NormalStream, exact_step
from ft_sensor import Wrench


@dataclass(frozen=True, slots=True)
class ErrorScale:
    """How far the readings of one kind of axis are off, in the axis' own unit.

    Attributes:
        bias: standard deviation over trials of a constant offset.
        drift: standard deviation of an Ornstein-Uhlenbeck process.
        white: standard deviation of the noise of each sample.
        resolution: step of the output.
        drift_time: correlation time of the drift [s].
    """

    bias: float
    drift: float
    white: float
    resolution: float
    drift_time: float = 3.0


_MOST_OFFSET = 3.5  # standard deviations of one axis
FORCE_ERRORS = ErrorScale(bias=0.24, drift=0.22, white=0.30, resolution=0.02)
TORQUE_ERRORS = ErrorScale(bias=0.01, drift=0.01, white=0.01, resolution=0.001)


class SensorErrors:
    """What the sensor adds to the truth: offset, bias, drift, noise and steps.

    The offset stays for a session; a tare takes it away. Bias and drift are a trial's:
    what its tare did not take away. Low-frequency error dominates on purpose: white
    noise alone averages away.
    """

    def __init__(
        self,
        rng: np.random.Generator,
        force: ErrorScale = FORCE_ERRORS,
        torque: ErrorScale = TORQUE_ERRORS,
    ) -> None:
        self._scales = (force,) * 3 + (torque,) * 3
        self.offset = [0.0] * 6
        self.new_trial(rng)
        self.offset = self._level = _within(self._level, force.bias)

    def new_trial(self, rng: np.random.Generator) -> None:
        """Draw bias and drift from `rng`, and everything after from it too."""
        self._normals = NormalStream(rng)
        pairs = zip(self.offset, self._scales, strict=True)
        self._level = [o + s.bias * self._normals.next() for o, s in pairs]
        self._drifts = [s.drift * self._normals.next() for s in self._scales]
        self._is_settled = False
        self._t_ns: int | None = None
        self._pace_drifts(0)

    def settle(self) -> None:
        """Show offset, noise and steps only, until the next trial.

        The error of a trial is what remains after its tare. A tare that saw the bias
        of the trial before would add it to the next one's.
        """
        self._level, self._drifts = self.offset, [0.0] * 6
        self._is_settled = True
        self._pace_drifts(self._step_ns)

    def apply(self, t_ns: int, wrench: Sequence[float]) -> Wrench:
        """Return what is shown at `t_ns` under `wrench` [N, N m], shape (6,)."""
        before_ns, self._t_ns = self._t_ns, t_ns
        step_ns = t_ns - before_ns if before_ns is not None and t_ns > before_ns else 0
        if step_ns != self._step_ns:  # samples come at an almost even pace
            self._pace_drifts(step_ns)
        next_normal = self._normals.next
        shown: list[float] = []
        drifts: list[float] = []
        rows = zip(wrench, self._level, self._drifts, self._steps, strict=True)
        for load, level, drift, (keep, kick, white, step) in rows:
            moved = keep * drift + kick * next_normal()
            value = load + level + moved + white * next_normal()
            drifts.append(moved)
            shown.append(round(value / step) * step if step else value)
        self._drifts = drifts
        fx, fy, fz, tx, ty, tz = shown
        return fx, fy, fz, tx, ty, tz

    def _pace_drifts(self, step_ns: int) -> None:
        """Let the drifts step by `step_ns` from now on."""
        self._step_ns, dt = step_ns, step_ns * 1e-9
        steps = [exact_step(s.drift, s.drift_time, dt) for s in self._scales]
        if self._is_settled:
            steps = [(0.0, 0.0)] * 6
        pairs = zip(steps, self._scales, strict=True)
        self._steps = [(*step, s.white, s.resolution) for step, s in pairs]


def _within(offset: list[float], scale: float) -> list[float]:
    """Return `offset` with a force of at most 3.5 times `scale`.

    One in 150 would have more; a sensor like that is sent back,
    and the residual of a tare would refuse every trial with it.
    """
    size = math.hypot(*offset[:3])
    most = _MOST_OFFSET * scale
    if size <= most:
        return offset
    return [value * most / size for value in offset[:3]] + offset[3:]
