"""Which ground the foot slides on, while it slides.

Two kinds of evidence, both from sliding ticks alone (0.005 to 0.2 m/s):

    surface   a logistic regression on features of the last 0.25, 0.5 or 1 s of sliding
    terrain   log odds l_k += w (-min(z_k^2, 16)/2 - ln s_k), z_k = (F_t - m_k)/s_k,
              bounded by l_max - l_k <= 7

The tempering w stands for residuals that are correlated over 50 to 100 ms. At rest both
hold. A density outside what the likeliest terrain's own windows show is "none of them".
"""

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from math import exp, log
from typing import Annotated, Final

from pydantic import AfterValidator, Field

from acquisition.validation import Many
from analysis.foresight.ground_window import FASTEST, SLOWEST, WINDOWS, GroundWindow
from analysis.foresight.logistic import RidgeLogistic
from analysis.foresight.stored import Number, Range, Word, increasing

JUDGED: Final = 50  # sliding ticks over which a density is judged
SHARES: Final = (0.002, 0.01, 0.02, 0.5, 0.98, 0.99, 0.998)  # of the densities' limits
_TEMPER = 0.1
_BOUND = 7.0
_FAR = 16.0  # z^2 beyond which a tick says no more
_UNUSUAL = 0.04  # two-sided share of a terrain's own windows below which it is doubted
_LogSd = Annotated[Number, Field(ge=-100.0, le=100.0)]
_Densities = Annotated[
    Many[Number],
    Field(min_length=len(SHARES), max_length=len(SHARES)),
    AfterValidator(increasing),
]


def log_speed(v_t: float) -> float:
    """Return ln v_t, within the velocities of sliding."""
    return log(SLOWEST if v_t < SLOWEST else FASTEST if v_t > FASTEST else v_t)


@dataclass(frozen=True, slots=True)
class GroundLaw:
    """F_t of a terrain while the foot slides, u = ln v_t.

    m = a0 + a1 F_n + a2 u + a3 F_n^2 + a4 F_n u + a5 u^2, ln s = b0 + b1 F_n + b2 u

    Attributes:
        name: of the terrain.
        surface: "flat", "rocky" or a word of its own.
        mean: a0 to a5 [N].
        log_sd: b0 to b2 [ln N].
        loads: F_n between which it was fitted [N]; outside, the ends hold.
        densities: mean log density of its own windows at `SHARES`, increasing.
    """

    name: Word
    surface: Word
    mean: tuple[Number, Number, Number, Number, Number, Number]
    log_sd: tuple[_LogSd, _LogSd, _LogSd]
    loads: Range
    densities: _Densities

    def at(self, F_n: float, v_t: float) -> tuple[float, float]:
        """Return mean and ln of the standard deviation of F_t [N]."""
        return self.at_log(F_n, log_speed(v_t))

    def at_log(self, F_n: float, u: float) -> tuple[float, float]:
        """Return the same, u as of `log_speed`."""
        low, high = self.loads
        load = low if F_n < low else high if F_n > high else F_n
        a, b = self.mean, self.log_sd
        mean = a[0] + a[1] * load + a[2] * u
        mean += a[3] * load * load + a[4] * load * u + a[5] * u * u
        return mean, b[0] + b[1] * load + b[2] * u

    def log_density(self, F_t: float, F_n: float, u: float) -> float:
        """Return -min(z^2, 16)/2 - ln s of one tick, u as of `log_speed`."""
        mean, log_sd = self.at_log(F_n, u)
        z = (F_t - mean) * exp(-log_sd)
        return -0.5 * min(z * z, _FAR) - log_sd

    def doubt(self, density: float) -> float:
        """Return how unlike the terrain's own windows a mean log density is, 0..1.

        Zero within the middle 96 % of its own windows; one beyond all of them.
        """
        points = self.densities
        at = bisect_left(points, density)
        if at == 0 or at == len(points):
            return 1.0
        low, high = points[at - 1], points[at]
        part = (density - low) / (high - low) if high > low else 0.0
        share = SHARES[at - 1] + part * (SHARES[at] - SHARES[at - 1])
        tail = 2.0 * min(share, 1.0 - share)
        return 0.0 if tail >= _UNUSUAL else 1.0 - tail / _UNUSUAL


@dataclass(frozen=True, slots=True)
class GroundModel:
    """What is known of the grounds.

    Attributes:
        laws: of the terrains.
        surfaces: probability of rocky ground by size of the window [ticks]; empty
            where only one surface was recorded.
    """

    laws: tuple[GroundLaw, ...]
    surfaces: tuple[tuple[int, RidgeLogistic], ...]


class SurfaceRecogniser:
    """Probability of rocky ground, sliding tick by sliding tick.

    Attributes:
        window: the last sliding ticks.
    """

    __slots__ = ("_is_asked_early", "_judged", "_rocky", "_surfaces", "window")

    def __init__(
        self, surfaces: Sequence[tuple[int, RidgeLogistic]], slid: int = 0
    ) -> None:
        """Begin without a tick.

        Args:
            surfaces: as of `GroundModel`.
            slid: ticks that the foot has slid since it was set down.
        """
        self._surfaces, self.window = surfaces, GroundWindow(slid)
        self._rocky: float | None = None
        self._judged = 0  # ticks of the window when it was judged
        # the shortest window alone keeps its last answer of the first 0.5 s
        self._is_asked_early = [size for size, _ in surfaces] == [WINDOWS[0]]

    def push(self, tick: int, v: float, F_t: float, F_n: float) -> None:
        """Take a sliding tick; arguments as of `GroundWindow.push`."""
        self.window.push(tick, v, F_t, F_n)
        if self._is_asked_early:
            self._judge()

    @property
    def rocky(self) -> float | None:
        """Probability of rocky ground; None before 0.25 s of sliding."""
        if self._judged != self.window.count:
            self._judge()
        return self._rocky

    def _judge(self) -> None:
        """Take the surer of the windows of 0.5 and 1 s; the first 0.25 s before."""
        self._judged = count = self.window.count
        best = None
        for size, regression in self._surfaces:
            if size > count:
                break
            if size == WINDOWS[0] and count >= WINDOWS[1]:
                continue
            p = regression.probability(self.window.features(size))
            if best is None or abs(p - 0.5) >= abs(best - 0.5) or size == WINDOWS[1]:
                best = p
        if best is not None:
            self._rocky = best


class GroundRecogniser:
    """Probability of every known terrain, sliding tick by sliding tick."""

    __slots__ = ("_model", "_odds", "_recent", "_sums", "_surface")

    def __init__(self, model: GroundModel) -> None:
        self._model = model
        self.reset()

    def reset(self) -> None:
        """Return to knowing nothing: the foot was lifted, or a trial begins."""
        self._begin(slid=0)

    def forget(self) -> None:
        """Forget the ground but not that the foot has slid: samples were lost."""
        self._begin(slid=self.window.slid)

    def _begin(self, slid: int) -> None:
        count = len(self._model.laws)
        self._odds = [0.0] * count
        self._sums = [0.0] * count
        self._recent: list[tuple[float, ...]] = []
        self._surface = SurfaceRecogniser(self._model.surfaces, slid)

    @property
    def is_informed(self) -> bool:
        """Whether the foot has slid for 0.25 s since the beginning."""
        return self.window.count >= WINDOWS[0]

    @property
    def rocky(self) -> float | None:
        """Probability of rocky ground; None before 0.25 s of sliding."""
        return self._surface.rocky

    @property
    def window(self) -> GroundWindow:
        """The last sliding ticks."""
        return self._surface.window

    def push(self, tick: int, v: float, F_t: float, F_n: float) -> None:
        """Take a sliding tick; arguments as of `GroundWindow.push`."""
        odds, sums = self._odds, self._sums
        u = log_speed(v)
        densities = tuple([law.log_density(F_t, F_n, u) for law in self._model.laws])
        self._recent.append(densities)
        old = self._recent.pop(0) if len(self._recent) > JUDGED else None
        for k, density in enumerate(densities):
            odds[k] += _TEMPER * density
            sums[k] += density
            if old is not None:
                sums[k] -= old[k]
        most = max(odds)
        for k, value in enumerate(odds):  # the largest is kept at zero
            odds[k] = max(value - most, -_BOUND)
        self._surface.push(tick, v, F_t, F_n)

    def probabilities(self) -> tuple[list[float], float]:
        """Return the probability of every terrain, and that it is none of them."""
        weights = [exp(value) for value in self._odds]
        laws, rocky = self._model.laws, self.rocky
        if rocky is not None:
            share = {"rocky": rocky, "flat": 1.0 - rocky}
            totals = dict.fromkeys(share, 0.0)
            for law, weight in zip(laws, weights, strict=True):
                if law.surface in totals:
                    totals[law.surface] += weight
            for k, law in enumerate(laws):
                if totals.get(law.surface, 0.0) > 0.0:
                    weights[k] *= share[law.surface] / totals[law.surface]
        total = 0.0
        for weight in weights:
            total += weight
        none = self._none(weights)
        return [(1.0 - none) * weight / total for weight in weights], none

    def _none(self, weights: Sequence[float]) -> float:
        if len(self._recent) < JUDGED:
            return 0.0
        best = max(range(len(weights)), key=weights.__getitem__)
        return self._model.laws[best].doubt(self._sums[best] / JUDGED)
