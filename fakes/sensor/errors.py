"""What the gauges of a wrist sensor add to the true load."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from fakes.randomness import NormalStream, exact_step
from ft_sensor.reading import Wrench


@dataclass(frozen=True, slots=True)
class ErrorScale:
    """How far the readings of one kind of axis are off, in the axis' own unit.

    Attributes:
        walk: standard deviation of the zero over minutes.
        drift: standard deviation of the zero over seconds.
        white: standard deviation of the noise of each sample.
        resolution: step of the output.
        creep: share of the load that the reading takes on late.
        hysteresis: share of a change of load that the reading lags behind.
        span: load that the shares of `hysteresis` and `cross_talk` refer to.
        cross_talk: standard deviation of the share of another axis' load that shows
            in this one, both in spans.
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


# A tare of a second and this drift are 0.3 N apart, as a good sensor is accurate to.
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
PER_DEGREE = (0.05, 0.05, 0.15, 0.002, 0.002, 0.002)  # [N, N m]; what warmth adds

NO_SHIFT: Wrench = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

_SLOW_NS = 10_000_000  # between two updates of what changes over seconds
_CREEP_TIME = 20.0  # s
_LAGGING = 0.05  # of the span: a larger change of load pulls the reading along
_WARMTH, _WARMTH_TIME = 0.3, 300.0  # of the room and the arm [degrees Celsius], s


class SensorErrors:
    """What the sensor adds to the truth, as one process from power-on to power-off.

    Seconds and minutes of drift, warmth, creep, hysteresis, cross-talk, noise and
    steps. Nothing begins anew with a trial or stops for a tare: a tare takes away what
    is there at its moment. Low-frequency error dominates on purpose: white noise alone
    averages away.

    Attributes:
        warmth: how far the sensor is from its usual temperature [degrees Celsius].
        shift: what a fault has added to the zero [N, N m].
    """

    def __init__(
        self,
        rng: np.random.Generator,
        force: ErrorScale = FORCE_ERRORS,
        torque: ErrorScale = TORQUE_ERRORS,
    ) -> None:
        """Draw the sensor and the state that it is switched on in from `rng`."""
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
        self._pace_drifts(0)

    def draw_from(self, rng: np.random.Generator) -> None:
        """Draw everything random from `rng` from now on; the process goes on."""
        self._normals = NormalStream(rng)

    def apply(self, t_ns: int, wrench: Sequence[float]) -> Wrench:
        """Return what is shown at `t_ns` under `wrench` [N, N m], shape (6,)."""
        before_ns, self._t_ns = self._t_ns, t_ns
        step_ns = t_ns - before_ns if before_ns is not None and t_ns > before_ns else 0
        if step_ns != self._step_ns:  # samples come at an almost even pace
            self._pace_drifts(step_ns)
        if self._slow_ns is None or t_ns - self._slow_ns >= _SLOW_NS:
            self._update_slow(t_ns, wrench)
        next_normal = self._normals.next
        shown: list[float] = []
        drifts: list[float] = []
        rows = zip(wrench, self._slow, self._drifts, self._steps, strict=True)
        for load, slow, drift, (keep, kick, white, step) in rows:
            moved = keep * drift + kick * next_normal()
            value = load + slow + moved + white * next_normal()
            drifts.append(moved)
            shown.append(round(value / step) * step if step else value)
        self._drifts = drifts
        fx, fy, fz, tx, ty, tz = shown
        return fx, fy, fz, tx, ty, tz

    def _pace_drifts(self, step_ns: int) -> None:
        """Let the drifts step by `step_ns` from now on."""
        self._step_ns, dt = step_ns, step_ns * 1e-9
        self._steps = [
            (*exact_step(s.drift, s.drift_time, dt), s.white, s.resolution)
            for s in self._scales
        ]

    def _update_slow(self, t_ns: int, wrench: Sequence[float]) -> None:
        """Let walk, warmth and the effects of the load go on to `t_ns`."""
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
    """What the load itself makes the reading miss: creep, hysteresis, cross-talk."""

    def __init__(self, scales: Sequence[ErrorScale], rng: np.random.Generator) -> None:
        """Draw the cross-talk of one sensor from `rng`."""
        span = np.array([scale.span for scale in scales])
        talk = np.array([[scale.cross_talk] for scale in scales])
        talk = talk * rng.standard_normal((6, 6)) * span[:, None] / span
        np.fill_diagonal(talk, 0.0)
        # Share of the loads by column that shows in the axes by row.
        self._cross_talk: list[list[float]] = talk.tolist()
        lagging: list[float] = (_LAGGING * span).tolist()
        # Creep, hysteresis and largest stretch [N, N m] of each axis.
        self._rows = [
            (scale.creep, scale.hysteresis, most)
            for scale, most in zip(scales, lagging, strict=True)
        ]
        self._stretch: Sequence[float] = (0.0,) * 6
        self._before: Sequence[float] | None = None

    def update(self, dt: float, wrench: Sequence[float]) -> list[float]:
        """Return the errors [N, N m], six, `dt` [s] after the last update."""
        if self._before is None:  # it has hung on the arm for long
            self._before = self._taken_on = wrench
        share = _crept(dt)
        stretches, taken_on, errors = list[float](), list[float](), list[float]()
        # Plain numbers: for six of them numpy takes three times as long.
        rows = zip(
            wrench,
            self._before,
            self._stretch,
            self._taken_on,
            self._rows,
            [_dot(row, wrench) for row in self._cross_talk],
            strict=True,
        )
        for load, before, stretch, taken, (creep, hysteresis, most), talk in rows:
            moved = stretch + load - before
            lag = most if moved > most else -most if moved < -most else moved
            slow = taken + share * (load - taken)
            stretches.append(lag)
            taken_on.append(slow)
            errors.append(creep * (slow - load) - hysteresis * lag + talk)
        self._before = wrench
        self._stretch, self._taken_on = stretches, taken_on
        return errors


def _dot(row: Sequence[float], wrench: Sequence[float]) -> float:
    """Return the scalar product; `sum` rounds as the version of Python does."""
    a, b, c, d, e, f = row
    fx, fy, fz, tx, ty, tz = wrench
    return a * fx + b * fy + c * fz + d * tx + e * ty + f * tz


@lru_cache(maxsize=64)
def _crept(dt: float) -> float:
    """Return the share of its way that the creep goes in `dt` [s]."""
    return 1.0 - math.exp(-dt / _CREEP_TIME)
