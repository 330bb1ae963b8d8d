"""Causal filters and the features of one tick, in plain floats.

Every recursion adds in a fixed order, without a linear algebra library, so that the
same samples give the same bits live and from the record. Nothing looks ahead; what a
filter is late by stands in `LAGS`.

A slope is that of the straight line through the last n samples, taken at the newest.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import exp, log, sqrt
from typing import Final

from acquisition.clock import PERIOD_NS

PERIOD: Final = PERIOD_NS * 1e-9  # s
EVERY: Final = 5  # cycles between two ticks: 10 ms
MEMORY: Final = (
    100  # samples: 0.2 s of x and F_n, the longest that a feature looks back
)
SLIP_SPEED, EDGE_SPEED = 0.12, 0.03  # m/s that makes a stretch a slip, and its edges
LEAST_LOAD: Final = 0.7  # N; ratios are not taken below
LEAST_PEAK = 0.5  # N, of a largest F_t that F_t is taken over
FEATURES: Final = (
    "log F_t",
    "F_t/F_n",
    "log F_t/F_n",
    "F_n",
    "slope of F_t, 50 ms",
    "slope of F_t, 120 ms",
    "slope of F_n, 50 ms",
    "change of F_n, 200 ms",
    "v, 30 ms",
    "v, 100 ms",
    "v, 200 ms",
    "log v, 30 ms",
    "log v, 100 ms",
    "log v, 200 ms",
    "change of v, 50 ms",
    "log time since the last slip",
    "log way since the last slip",
    "way since the last slip",
    "F_t over its largest since the last slip",
    "rms of F_t above 3 Hz, 100 ms",
    "rms of v, 100 ms",
    "creep, 100 ms",
    "creep, 200 ms",
)
# s by which a field of a tick is later than the newest sample
LAGS: Final[Mapping[str, float]] = {
    "v_t": 0.014,
    "F_t": 0.008,
    "F_n": 0.008,
    "slope_F_t": 0.024,
}
SMOOTH = exp(-PERIOD / 0.008)  # of the forces
SLOW = exp(-PERIOD * 2.0 * 3.141592653589793 * 3.0)  # 3 Hz
POWER = exp(-PERIOD / 0.1)  # of both rms
STIFFNESS = 2200.0  # N/m of a foot that has not begun to slip
LEAST_FORCE, LEAST_SPEED, LEAST_WAY, LEAST_TIME = 0.1, 2e-4, 1e-4, 0.01
LONGEST, FARTHEST = 3.0, 0.1  # s, m since the last slip that still count


@dataclass(frozen=True, slots=True)
class FootSample:
    """One cycle of the loop as foresight reads it.

    Attributes:
        cycle: its number.
        host_ns: its time [ns].
        x: way of the sole along x_T [m].
        F_t: traction [N].
        F_n: normal force [N].
    """

    cycle: int
    host_ns: int
    x: float
    F_t: float
    F_n: float


class Track:
    """The last samples of one signal."""

    __slots__ = ("_at", "_values")

    def __init__(self, first: float) -> None:
        self._values = [first] * (MEMORY + 1)
        self._at = 0

    def push(self, value: float) -> None:
        """Append the newest sample."""
        at = self._at + 1
        if at > MEMORY:
            at = 0
        self._values[at] = value
        self._at = at

    def ago(self, samples: int) -> float:
        """Return the sample so many before the newest, at most `MEMORY`."""
        return self._values[self._at - samples]  # a negative index wraps by itself


class Slope:
    """Slope of the straight line through the last n samples, at the newest."""

    __slots__ = ("_half", "_moment", "_n", "_scale", "_sum", "_track")

    def __init__(self, track: Track, n: int) -> None:
        first = track.ago(0)
        self._track, self._n = track, n
        self._half = 0.5 * (n - 1)
        self._scale = 12.0 / (n * (n * n - 1.0) * PERIOD)
        self._sum = n * first
        self._moment = self._half * self._sum

    def advance(self) -> None:
        """Take in the sample that was pushed last on the track."""
        track, n = self._track, self._n
        oldest = track.ago(n)
        self._moment += self._sum - n * oldest
        self._sum += track.ago(0) - oldest

    @property
    def value(self) -> float:
        """The slope [1/s times the signal]."""
        return (self._half * self._sum - self._moment) * self._scale


class Signals:
    """Position and forces of the foot, filtered sample by sample.

    Attributes:
        count: samples since the filters began.
        v_t: slip velocity [m/s].
        F_t: traction [N].
        F_n: normal force [N].
        is_slipping: v_t rose above 0.12 m/s and has not been below 0.03 m/s since.
    """

    __slots__ = (
        "F_n",
        "F_t",
        "_F_nt",
        "_F_tt",
        "_largest",
        "_loading",
        "_low",
        "_power_F",
        "_power_v",
        "_pressing",
        "_ramp",
        "_slip_ended",
        "_slip_x",
        "_speed",
        "_v",
        "_x",
        "count",
        "is_slipping",
        "v_t",
    )

    def __init__(self, x: float, F_t: float, F_n: float) -> None:
        """Begin with one sample: the foot is taken to have stood there for long."""
        self.count = 1
        self.v_t, self.F_t, self.F_n = 0.0, F_t, F_n
        self.is_slipping = False
        self._x, self._v = Track(x), Track(0.0)
        self._F_tt, self._F_nt = Track(F_t), Track(F_n)
        self._speed = Slope(self._x, 15)
        self._ramp, self._loading = Slope(self._F_tt, 25), Slope(self._F_tt, 60)
        self._pressing = Slope(self._F_nt, 25)
        self._low = F_t
        self._power_F = self._power_v = 0.0
        self._slip_ended, self._slip_x, self._largest = 0, x, F_t

    def push(self, x: float, F_t: float, F_n: float) -> None:
        """Take one sample, one period after the last.

        Args:
            x: way of the sole along x_T [m].
            F_t: traction [N].
            F_n: normal force [N].
        """
        self.count += 1
        self._x.push(x)
        self._F_tt.push(F_t)
        self._F_nt.push(F_n)
        self._speed.advance()
        self._ramp.advance()
        self._loading.advance()
        self._pressing.advance()
        self.v_t = v = self._speed.value
        self._v.push(v)
        self.F_t = F_t + SMOOTH * (self.F_t - F_t)
        self.F_n = F_n + SMOOTH * (self.F_n - F_n)
        self._low = F_t + SLOW * (self._low - F_t)
        high = self.F_t - self._low
        self._power_F = high * high + POWER * (self._power_F - high * high)
        self._power_v = v * v + POWER * (self._power_v - v * v)
        self._follow_slip(v)

    def _follow_slip(self, v: float) -> None:
        if self.is_slipping:
            if v < EDGE_SPEED:
                self.is_slipping = False
                self._slip_ended, self._slip_x = self.count, self._x.ago(0)
                self._largest = self.F_t
        elif v > SLIP_SPEED:
            self.is_slipping = True
        elif self.F_t > self._largest:
            self._largest = self.F_t

    @property
    def is_warm(self) -> bool:
        """Whether every feature has the samples that it looks back on."""
        return self.count > MEMORY

    def features(self) -> list[float]:
        """Return the numbers of `FEATURES`."""
        F_t, F_n, x, v = self.F_t, self.F_n, self._x, self.v_t
        now, push = x.ago(0), self._F_tt
        force = max(F_t, LEAST_FORCE)
        ratio = F_t / max(F_n, LEAST_LOAD)
        way50, way100 = now - x.ago(50), now - x.ago(100)
        v30, v100, v200 = (now - x.ago(15)) / 0.03, way50 / 0.1, way100 / 0.2
        waited = min((self.count - self._slip_ended) * PERIOD, LONGEST)
        gone = min(max(now - self._slip_x, 0.0), FARTHEST)
        return [
            log(force),
            ratio,
            log(force / max(F_n, LEAST_LOAD)),
            F_n,
            self._ramp.value,
            self._loading.value,
            self._pressing.value,
            self._F_nt.ago(0) - self._F_nt.ago(100),
            v30,
            v100,
            v200,
            log(max(v30, LEAST_SPEED)),
            log(max(v100, LEAST_SPEED)),
            log(max(v200, LEAST_SPEED)),
            v - self._v.ago(25),
            log(max(waited, LEAST_TIME)),
            log(gone + LEAST_WAY),
            gone,
            F_t / max(self._largest, LEAST_PEAK),
            sqrt(max(self._power_F, 0.0)),
            sqrt(max(self._power_v, 0.0)),
            way50 - (push.ago(0) - push.ago(50)) / STIFFNESS,
            way100 - (push.ago(0) - push.ago(100)) / STIFFNESS,
        ]
