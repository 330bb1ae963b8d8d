"""Bootstrap intervals of the Tustin parameters from resampled trials.

Samples of one trial are strongly correlated, so s^2 (J'J)^-1 would be far too small.
Whole trials are drawn with replacement instead, and every draw is fitted.
"""

from collections.abc import Sequence

import numpy as np

from analysis.data.series import Array
from analysis.tustin.identifiability import Interval
from analysis.tustin.model import TustinBounds, TustinFit, TustinForm
from analysis.tustin.moments import Moments, solve_moments, zoom
from analysis.tustin.varpro import Box, Problem

DRAWS = 200
_GRID = (12, 8)

Rows = tuple[Array, Array, Array]


def bootstrap_tustin(
    trials: Sequence[Rows],
    fit: TustinFit,
    rng: np.random.Generator,
    bounds: TustinBounds | None = None,
    draws: int = DRAWS,
) -> dict[str, Interval]:
    """Return the 95 % percentile interval of every parameter.

    Args:
        trials: (F_n, v_t, F_t) of every trial.
        fit: the fit to all trials; an additional start for every draw.
        rng: random generator for the draws.
        bounds: box of the search.
        draws: number of bootstrap draws.
    """
    box = (bounds or TustinBounds()).box()
    moments = _moments(trials, fit.form, box)
    picks = rng.integers(len(trials), size=(draws, len(trials)))
    counts = np.array([np.bincount(pick, minlength=len(trials)) for pick in picks])
    sums = np.tensordot(counts.astype(float), moments.sums, axes=1)
    warm = np.log([fit.parameters.v_s, fit.parameters.delta_s])
    q = _zoom(sums, moments.v, _coarse(sums, moments.v, box, warm), box)
    p, _ = solve_moments(sums, moments.v, q, box)
    columns = (p[:, 0], p[:, 1], np.exp(q[:, 0]), np.exp(q[:, 1]), p[:, 2])
    names = ("mu", "F_s", "v_s", "delta_s", "b")
    return {
        name: Interval(*(float(x) for x in np.percentile(column, [2.5, 97.5])))
        for name, column in zip(names, columns, strict=True)
    }


def _moments(trials: Sequence[Rows], form: TustinForm, box: Box) -> Moments:
    F_n, v_t, F_t = (np.concatenate(column) for column in zip(*trials, strict=True))
    problem = Problem((F_n, v_t, F_t), box, is_proportional=form.is_proportional)
    return Moments.of(problem, [trial[0].size for trial in trials])


def _coarse(sums: Array, v: Array, box: Box, warm: Array) -> Array:
    """Return the best of grid and warm start for every draw, shape (draws, 2)."""
    axes = [
        np.linspace(low, high, count)
        for (low, high), count in zip(box.logarithmic, _GRID, strict=True)
    ]
    grid = np.vstack([warm, np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)])
    sse = np.array([solve_moments(draw, v, grid, box)[1] for draw in sums])
    return grid[np.argmin(sse, axis=1)]


def _zoom(sums: Array, v: Array, q: Array, box: Box) -> Array:
    """Refine the points by pattern search with halving steps."""
    low, high = box.logarithmic.T

    def sse(near: Array) -> Array:
        points = near.swapaxes(0, 1)
        return np.stack([solve_moments(sums, v, q, box)[1] for q in points], axis=1)

    step = (high - low) / (np.array(_GRID) - 1.0)
    return zoom(sse, q, step, box.logarithmic)
