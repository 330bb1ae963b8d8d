"""Model-free features of a window of motion.

A window is a number of kept samples; its stretch is every thinned sample from its first
to its last, including those in which the foot sticks, slips fast or bounces back.
Features depend on the stretch alone, so that a live process computes the same numbers.
"""

from dataclasses import dataclass

import numpy as np

from analysis.data.prepare import PreparedTrial
from analysis.data.series import Array

WINDOWS = (50, 100, 200)  # kept samples: 0.5, 1 and 2 s of motion
FEATURES = (
    "log sd of F_t about a line in F_n",
    "log range of F_t",
    "log range of F_n",
    "log sd of the steps of F_t",
    "log sd of the steps of v_t",
    "log of the largest step of F_t",
    "log of the largest v_t",
    "smallest v_t, asinh(v/0.01)",
    "share of sticking",
    "log of the time taken",
    "F_t/F_n of the means",
    "log mean F_t",
    "slope of F_t on F_n",
)
ROUGHNESS = 0  # index of the feature that separates rough from smooth ground
_STRIDES = 5  # overlapping windows begin at every fifth of their size
_STICKING = 0.005  # m/s
_LEAST = 1e-3  # N, m/s or s, lower limit of values in logarithms
_LEAST_LOAD = 1.0  # N, lower limit of the load in ratios
_LARGEST_RATIO = 10.0
_CURL = 0.01  # m/s


@dataclass(frozen=True, slots=True)
class Stretch:
    """The thinned samples that a window spans.

    Attributes:
        t: time [s], shape (n,).
        v_t: velocity [m/s], shape (n,).
        F_n: normal force [N], shape (n,).
        F_t: traction force [N], shape (n,).
        is_kept: inside the velocity window, shape (n,).
    """

    t: Array
    v_t: Array
    F_n: Array
    F_t: Array
    is_kept: np.ndarray

    def features(self) -> Array:
        """Return the features in the order of `FEATURES`, shape (13,)."""
        F_n, F_t = self.F_n[self.is_kept], self.F_t[self.is_kept]
        slope, sd = _line(F_n, F_t)
        steps = np.diff(self.F_t)
        load = max(float(F_n.mean()), _LEAST_LOAD)
        ratio = float(np.clip(F_t.mean() / load, -_LARGEST_RATIO, _LARGEST_RATIO))
        return np.array(
            [
                _log(sd),
                _log(float(np.ptp(self.F_t))),
                _log(float(np.ptp(self.F_n))),
                _log(_spread(steps)),
                _log(_spread(np.diff(self.v_t))),
                _log(float(np.abs(steps).max(initial=0.0))),
                _log(float(self.v_t.max())),
                float(np.arcsinh(self.v_t.min() / _CURL)),
                float((np.abs(self.v_t) < _STICKING).mean()),
                _log(float(self.t[-1] - self.t[0])),
                ratio,
                _log(float(F_t.mean())),
                slope,
            ]
        )


def windows_of(kept: int, size: int, *, overlap: bool = False) -> list[slice]:
    """Return windows of `size` kept samples; a remainder is dropped.

    Args:
        kept: number of kept samples.
        size: size of a window.
        overlap: begin a window at every fifth of the size instead of consecutively.
    """
    step = max(size // _STRIDES, 1) if overlap else size
    return [slice(k, k + size) for k in range(0, kept - size + 1, step)]


def window_features(trial: PreparedTrial, windows: list[slice]) -> Array:
    """Return the features of windows of a trial, shape (windows, 13)."""
    rows = [stretch_of(trial, window).features() for window in windows]
    return np.array(rows).reshape(-1, len(FEATURES))


def stretch_of(trial: PreparedTrial, window: slice) -> Stretch:
    """Return the stretch of a window of kept samples."""
    chosen = trial.indices[window]
    rows = np.arange(chosen[0], chosen[-1] + 1, trial.widths[1])
    smooth = trial.smooth
    return Stretch(
        t=smooth.t[rows],
        v_t=smooth.v_t[rows],
        F_n=smooth.F_n[rows],
        F_t=smooth.F_t[rows],
        is_kept=np.isin(rows, chosen),
    )


def _line(x: Array, y: Array) -> tuple[float, float]:
    """Return the slope, and the sd of y about the fitted line in x."""
    dx, dy = x - x.mean(), y - y.mean()
    variance = float(dx @ dx)
    slope = float(dx @ dy) / variance if variance > _LEAST**2 else 0.0
    slope = float(np.clip(slope, -_LARGEST_RATIO, _LARGEST_RATIO))
    return slope, float(np.sqrt(np.mean((dy - slope * dx) ** 2)))


def _spread(values: Array) -> float:
    return float(values.std()) if values.size else 0.0


def _log(value: float) -> float:
    return float(np.log(max(value, _LEAST)))
