"""The last second of sliding: features that tell surfaces apart, by running sums."""

from collections.abc import Sequence
from math import log
from typing import Final

import numpy as np

from analysis.data.series import Array, Indices
from analysis.foresight.signals import LEAST_LOAD

WINDOWS: Final = (25, 50, 100)  # sliding ticks: 0.25, 0.5 and 1 s
SLOWEST, FASTEST = 0.005, 0.2  # m/s of sliding
GROUND_FEATURES: Final = (
    "log mean of F_t/F_n",
    "log sd of F_t/F_n",
    "log mean of F_t",
    "log sd of F_t",
    "log mean of v_t",
    "log sd of v_t",
    "log mean of F_n",
    "slope of F_t on F_n",
    "log sd of F_t about a line in F_n",
    "log rms step of F_t",
    "log rms step of v_t",
    "log time taken",
    "log range of F_n",
    "log largest v_t",
    "change of F_n",
    "change of F_t/F_n",
    "log ticks slid since the foot was set down",
)
_LEAST = 1e-3
_LEAST_VARIANCE = 1e-6
_SPREAD = 0.05  # N^2, keeps a slope finite at a steady load
_EDGE = 10  # ticks at each end of a window whose means make its change
_OLDEST = 200  # ticks since the foot was set down that still count
_KEPT = 2 * WINDOWS[-1]
_EVERY_WINDOW = 5  # ticks from one window that is learnt from to the next


class _Sums:
    """Running sums over the last n sliding ticks."""

    __slots__ = ("size", "values")

    def __init__(self, size: int) -> None:
        self.size = size
        self.values = [0.0] * 11

    def add(self, terms: Sequence[float], dropped: Sequence[float] | None) -> None:
        pairs = zip(self.values, terms, strict=True)
        if dropped is None:
            self.values = [value + term for value, term in pairs]
        else:
            self.values = [
                value + term - old
                for (value, term), old in zip(pairs, dropped, strict=True)
            ]


class GroundWindow:
    """The last sliding ticks, and what they show.

    Attributes:
        count: of sliding ticks in it since it began.
        slid: of sliding ticks since the foot was set down.
    """

    __slots__ = ("_F_n", "_ratio", "_sums", "_terms", "_ticks", "_v", "count", "slid")

    def __init__(self, slid: int = 0) -> None:
        """Begin without a tick.

        Args:
            slid: ticks that the foot has slid since it was set down.
        """
        self.count, self.slid = 0, slid
        self._terms: list[tuple[float, ...]] = []
        self._v: list[float] = []
        self._F_n: list[float] = []
        self._ratio: list[float] = []
        self._ticks: list[int] = []
        self._sums = tuple(_Sums(size) for size in WINDOWS)

    def push(self, tick: int, v: float, F_t: float, F_n: float) -> None:
        """Take a sliding tick.

        Args:
            tick: its number, every 10 ms.
            v: slip velocity [m/s].
            F_t: traction [N].
            F_n: normal force [N].
        """
        terms, ratio = self._terms, F_t / max(F_n, LEAST_LOAD)
        step_F = F_t - terms[-1][2] if terms else 0.0
        step_v = v - self._v[-1] if terms else 0.0
        new = (
            ratio,
            ratio * ratio,
            F_t,
            F_t * F_t,
            v,
            v * v,
            F_n,
            F_n * F_n,
            F_n * F_t,
            step_F * step_F,
            step_v * step_v,
        )
        for sums in self._sums:
            is_full = self.count >= sums.size
            sums.add(new, terms[-sums.size] if is_full else None)
        terms.append(new)
        self._v.append(v)
        self._F_n.append(F_n)
        self._ratio.append(ratio)
        self._ticks.append(tick)
        self.count += 1
        self.slid += 1
        if len(terms) > _KEPT:
            for kept in (terms, self._v, self._F_n, self._ratio, self._ticks):
                del kept[: WINDOWS[-1]]

    def features(self, size: int) -> list[float]:
        """Return the numbers of `GROUND_FEATURES` of the last `size` ticks."""
        r, rr, F, FF, v, vv, N, NN, NF, dF, dv = (
            value / size for value in self._sums[WINDOWS.index(size)].values
        )
        spread_N, with_N, spread_F = NN - N * N, NF - N * F, FF - F * F
        slope = with_N / (spread_N + _SPREAD)
        about = spread_F - 2.0 * slope * with_N + slope * slope * spread_N
        loads, ratios, ticks = self._F_n[-size:], self._ratio[-size:], self._ticks
        return [
            _log(r),
            _half_log(rr - r * r),
            _log(F),
            _half_log(spread_F),
            _log(v),
            _half_log(vv - v * v),
            _log(N),
            slope,
            _half_log(about),
            _half_log(dF),
            _half_log(dv),
            log((ticks[-1] - ticks[-size] + 1) / size),
            _log(max(loads) - min(loads)),
            _log(max(self._v[-size:])),
            _mean(loads[-_EDGE:]) - _mean(loads[:_EDGE]),
            _mean(ratios[-_EDGE:]) - _mean(ratios[:_EDGE]),
            log(min(self.slid, _OLDEST)),
        ]


def windows_of(tick: Indices, motion: Array) -> dict[int, Array]:
    """Return the features of overlapping windows, by their size.

    Args:
        tick: numbers of sliding ticks, shape (n,).
        motion: v_t [m/s], F_t [N], F_n [N] of each, shape (n, 3).
    """
    window = GroundWindow()
    rows: dict[int, list[list[float]]] = {size: [] for size in WINDOWS}
    for number, (v, F_t, F_n) in zip(tick.tolist(), motion.tolist(), strict=True):
        window.push(number, v, F_t, F_n)
        if window.count % _EVERY_WINDOW:
            continue
        for size in WINDOWS:
            if window.count >= size:
                rows[size].append(window.features(size))
    width = len(GROUND_FEATURES)
    return {
        size: np.array(features).reshape(-1, width) for size, features in rows.items()
    }


def _log(value: float) -> float:
    return log(max(value, _LEAST))


def _half_log(variance: float) -> float:
    return 0.5 * log(max(variance, _LEAST_VARIANCE))


def _mean(values: Sequence[float]) -> float:
    total = 0.0
    for value in values:  # `sum` rounds otherwise in later versions of Python
        total += value
    return total / len(values)
