"""Measurement errors of a wrist sensor's gauges."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from fakes.randomness import NormalStream, exact_step
from ft_sensor.reading import Wrench


@dataclass(frozen=True, slots=True)
class ErrorScale:
    """Error magnitudes of the force or the torque axes, in the axis' unit.

    Attributes:
        walk: standard deviation of the zero over minutes.
        drift: standard deviation of the zero over seconds.
        white: standard deviation of the noise of each sample.
        resolution: step of the output.
        creep: share of the load that appears with a delay.
        hysteresis: share of a change of load by which the reading lags.
        span: full scale for `hysteresis` and `cross_talk`.
        cross_talk: standard deviation of the share of another axis' load that appears
            in this one, both relative to their spans.
        drift_time: correlation time of the drift [s].
        walk_time: correlation time of the walk [s].
    """

    walk: float
    drift: float
    white: float
    resolution: float
    creep: float = 0.0
    hysteresis: float = 0.0
    span: float = 1.0
    cross_talk: float = 0.0
    drift_time: float = 3.0
    walk_time: float = 120.0


# With this drift, tares of one second differ by 0.3 N: the accuracy of a good sensor.
FORCE_ERRORS = ErrorScale(
    walk=0.10,
    drift=0.22,
    white=0.30,
    resolution=0.02,
    creep=0.005,
    hysteresis=0.01,
    span=100.0,
    cross_talk=0.003,
)
TORQUE_ERRORS = ErrorScale(
    walk=0.005,
    drift=0.01,
    white=0.01,
    resolution=0.001,
    creep=0.005,
    hysteresis=0.01,
    span=4.0,
    cross_talk=0.003,
)
PER_DEGREE = (0.05, 0.05, 0.15, 0.002, 0.002, 0.002)  # zero drift [N, N m]

NO_SHIFT: Wrench = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

_SLOW_NS = 10_000_000  # update period of the slow errors
_CREEP_TIME = 20.0  # s
_MAX_LAG = 0.05  # of the span: the hysteresis saturates beyond this change of load
_WARMTH, _WARMTH_TIME = 0.3, 300.0  # ambient temperature: sd [degrees Celsius], s


class SensorErrors:
    """Errors of a sensor, as one continuous process from power-on to power-off.

    Drift over seconds and minutes, temperature, creep, hysteresis, cross-talk, noise
    and quantisation. Neither a trial nor a tare restarts the process: a tare subtracts
    the error of its moment. Low-frequency error dominates on purpose: white noise alone
    averages out.

    Attributes:
        warmth: sensor temperature minus its usual one [degrees Celsius].
        shift: shift of the zero by a fault [N, N m].
    """

    def __init__(
        self,
        rng: np.random.Generator,
        force: ErrorScale = FORCE_ERRORS,
        torque: ErrorScale = TORQUE_ERRORS,
    ) -> None:
        """Draw the sensor and its state at power-on from `rng`."""
        self._scales = scales = (force,) * 3 + (torque,) * 3
        self._load_errors = LoadErrors(scales, rng)
        self.draw_from(rng)
        normal = self._normals.next
        has_drift = force.walk > 0.0 or force.drift > 0.0
        self._warmth_sd = _WARMTH if has_drift else 0.0
        self.warmth = self._warmth_sd * normal()
        self._walk = [scale.walk * normal() for scale in scales]
        self._drifts = [scale.drift * normal() for scale in scales]
        self.shift = NO_SHIFT
        self._slow = [0.0] * 6
        self._slow_ns: int | None = None
        self._t_ns: int | None = None
        self._set_drift_step(0)

    def draw_from(self, rng: np.random.Generator) -> None:
        """Draw from `rng` from now on; the process continues."""
        self._normals = NormalStream(rng)

    def apply(self, t_ns: int, wrench: Sequence[float]) -> Wrench:
        """Return the reading at `t_ns` under `wrench` [N, N m], shape (6,)."""
        before_ns, self._t_ns = self._t_ns, t_ns
        step_ns = t_ns - before_ns if before_ns is not None and t_ns > before_ns else 0
        if step_ns != self._step_ns:  # sample periods rarely change
            self._set_drift_step(step_ns)
        if self._slow_ns is None or t_ns - self._slow_ns >= _SLOW_NS:
            self._update_slow(t_ns, wrench)
        next_normal = self._normals.next
        reading: list[float] = []
        drifts: list[float] = []
        rows = zip(wrench, self._slow, self._drifts, self._steps, strict=True)
        for load, slow, drift, (keep, kick, white, step) in rows:
            next_drift = keep * drift + kick * next_normal()
            value = load + slow + next_drift + white * next_normal()
            drifts.append(next_drift)
            reading.append(round(value / step) * step if step else value)
        self._drifts = drifts
        fx, fy, fz, tx, ty, tz = reading
        return fx, fy, fz, tx, ty, tz

    def _set_drift_step(self, step_ns: int) -> None:
        """Precompute the drift steps for a sample period of `step_ns`."""
        self._step_ns, dt = step_ns, step_ns * 1e-9
        self._steps = [
            (*exact_step(s.drift, s.drift_time, dt), s.white, s.resolution)
            for s in self._scales
        ]

    def _update_slow(self, t_ns: int, wrench: Sequence[float]) -> None:
        """Advance walk, temperature and the load errors to `t_ns`."""
        passed_ns = 0 if self._slow_ns is None else t_ns - self._slow_ns
        self._slow_ns, dt, normal = t_ns, passed_ns * 1e-9, self._normals.next
        keep, kick = exact_step(self._warmth_sd, _WARMTH_TIME, dt)
        self.warmth = keep * self.warmth + kick * normal()
        walk: list[float] = []
        for value, scale in zip(self._walk, self._scales, strict=True):
            keep, kick = exact_step(scale.walk, scale.walk_time, dt)
            walk.append(keep * value + kick * normal())
        self._walk = walk
        errors = self._load_errors.update(dt, wrench)
        rows = zip(walk, PER_DEGREE, self.shift, errors, strict=True)
        self._slow = [
            zero + self.warmth * gain + shift + error
            for zero, gain, shift, error in rows
        ]


class LoadErrors:
    """Load-dependent errors: creep, hysteresis, cross-talk."""

    def __init__(self, scales: Sequence[ErrorScale], rng: np.random.Generator) -> None:
        """Draw the cross-talk of one sensor from `rng`."""
        span = np.array([scale.span for scale in scales])
        talk = np.array([[scale.cross_talk] for scale in scales])
        talk = talk * rng.standard_normal((6, 6)) * span[:, None] / span
        np.fill_diagonal(talk, 0.0)
        # Share of the load of each column that appears in the axis of each row.
        self._cross_talk: list[list[float]] = talk.tolist()
        max_lags: list[float] = (_MAX_LAG * span).tolist()
        # Creep, hysteresis and largest lag [N, N m] of each axis.
        self._rows = [
            (scale.creep, scale.hysteresis, max_lag)
            for scale, max_lag in zip(scales, max_lags, strict=True)
        ]
        self._lags: Sequence[float] = (0.0,) * 6
        self._before: Sequence[float] | None = None

    def update(self, dt: float, wrench: Sequence[float]) -> list[float]:
        """Return the errors [N, N m], six, `dt` [s] after the last update."""
        if self._before is None:  # the load has been applied for long
            self._before = self._crept_load = wrench
        share = _creep_share(dt)
        lags, crept_loads, errors = list[float](), list[float](), list[float]()
        # Plain floats: numpy takes three times as long for six values.
        rows = zip(
            wrench,
            self._before,
            self._lags,
            self._crept_load,
            self._rows,
            [_dot(row, wrench) for row in self._cross_talk],
            strict=True,
        )
        for load, before, last_lag, crept, (creep, hysteresis, max_lag), talk in rows:
            raw_lag = last_lag + load - before
            lag = (
                max_lag
                if raw_lag > max_lag
                else -max_lag
                if raw_lag < -max_lag
                else raw_lag
            )
            crept_load = crept + share * (load - crept)
            lags.append(lag)
            crept_loads.append(crept_load)
            errors.append(creep * (crept_load - load) - hysteresis * lag + talk)
        self._before = wrench
        self._lags, self._crept_load = lags, crept_loads
        return errors


def _dot(row: Sequence[float], wrench: Sequence[float]) -> float:
    """Return the dot product; the rounding of `sum` depends on the Python version."""
    a, b, c, d, e, f = row
    fx, fy, fz, tx, ty, tz = wrench
    return a * fx + b * fy + c * fz + d * tx + e * ty + f * tz


@lru_cache(maxsize=64)
def _creep_share(dt: float) -> float:
    """Return the share of the remaining creep that occurs in `dt` [s]."""
    return 1.0 - math.exp(-dt / _CREEP_TIME)
