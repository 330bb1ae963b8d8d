"""What the gauges of a wrist sensor add to the true load."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fakes.randomness import NormalStream, OrnsteinUhlenbeck
from ft_sensor.bota import Wrench


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


FORCE_ERRORS = ErrorScale(bias=0.24, drift=0.22, white=0.30, resolution=0.02)
TORQUE_ERRORS = ErrorScale(bias=0.01, drift=0.01, white=0.01, resolution=0.001)


class SensorErrors:
    """What the sensor adds to the truth: bias, drift, noise and steps.

    Low-frequency error dominates on purpose: white noise alone averages away. Bias and
    drift are drawn anew for each trial, all from the one generator given.
    """

    def __init__(
        self,
        rng: np.random.Generator,
        force: ErrorScale = FORCE_ERRORS,
        torque: ErrorScale = TORQUE_ERRORS,
    ) -> None:
        self._scales = (force,) * 3 + (torque,) * 3
        self.new_trial(rng)

    def new_trial(self, rng: np.random.Generator) -> None:
        """Draw bias and drift from `rng`, and everything after from it too."""
        self._normals = NormalStream(rng)
        self._bias = [s.bias * self._normals.next() for s in self._scales]
        self._drifts = [
            OrnsteinUhlenbeck(s.drift, s.drift_time, 0.0, self._normals)
            for s in self._scales
        ]
        self._step_ns = 0
        self._t_ns: int | None = None

    def apply(self, t_ns: int, wrench: Sequence[float]) -> Wrench:
        """Return what is shown at `t_ns` under `wrench` [N, N m], shape (6,)."""
        self._pace_drifts(0 if self._t_ns is None else max(t_ns - self._t_ns, 0))
        self._t_ns = t_ns
        next_normal = self._normals.next
        shown: list[float] = []
        for load, scale, bias, drift in zip(
            wrench, self._scales, self._bias, self._drifts, strict=True
        ):
            value = load + bias + drift.step() + scale.white * next_normal()
            step = scale.resolution
            shown.append(round(value / step) * step if step else value)
        fx, fy, fz, tx, ty, tz = shown
        return fx, fy, fz, tx, ty, tz

    def _pace_drifts(self, step_ns: int) -> None:
        """Let the drifts step by `step_ns`; samples come at an almost even pace."""
        if step_ns != self._step_ns:
            self._step_ns = step_ns
            for drift in self._drifts:
                drift.set_dt(step_ns * 1e-9)
