"""Samples of a Tustin fit as sums over narrow velocity bins.

Given (v_s, delta_s) the normal equations need the samples only through e(v) times
products of F_n, v_t, F_t and 1. Sums of those over bins of 2 % of velocity, one set per
trial, make a fit of any mixture of trials as cheap as a few hundred rows: the scan of a
search, profiles, and hundreds of bootstrap draws at once. What a search ends with comes
from the samples themselves.
"""

from collections.abc import Callable, Sequence
from typing import Literal, NamedTuple

import numpy as np

from analysis.data.series import Array
from analysis.tustin.box_least_squares import solve_in_box
from analysis.tustin.identifiability import Interval, Profiles, independent_samples
from analysis.tustin.varpro import (
    LARGEST_LOG_POWER,
    Box,
    Point,
    Problem,
    polish,
)

_BIN = 0.02  # width in log velocity
_MOST_BINS = 300
_CHI2_95 = 3.841458820694124  # of one degree of freedom
_GRID = (16, 14)  # points over log v_s and log delta_s
_POLISHED = 4  # starting cells, no two of them neighbours
_BLOCK = 128  # points at a time, so that their data stay in the cache
_ZOOMS = 8  # each halves the step
_STAR = np.array([(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)], dtype=float)
_STEEP = 100  # points along the largest exponent
_DISTINCT = 0.05  # distance in q below which two points lead to the same optimum
_POINTS, _ACROSS = 25, 24  # of a profile: along the fixed and the free parameter


class Moments(NamedTuple):
    """Sums over trials and bins.

    Attributes:
        v: mean velocity of every bin [m/s], shape (k,).
        sums: sums of the ten products of (F_n, static column, v_t, F_t), shape
            (trials, k, 10) in the order of `_PAIRS`.
    """

    v: Array
    sums: Array

    @classmethod
    def of(cls, problem: Problem, lengths: Sequence[int]) -> "Moments":
        """Sum the products of a problem whose trials have `lengths` rows."""
        log_v = problem.log_v
        width = max(_BIN, float(np.ptp(log_v)) / _MOST_BINS)
        index = np.floor((log_v - log_v.min()) / width).astype(np.intp)
        filled = np.bincount(index) > 0
        used, index = np.flatnonzero(filled), (np.cumsum(filled) - 1)[index]
        columns = (problem.F_n, problem.static, problem.v_t, problem.F_t)
        trial = np.repeat(np.arange(len(lengths)), lengths)
        cell, size = trial * used.size + index, len(lengths) * used.size
        sums = [
            np.bincount(cell, problem.weights * columns[a] * columns[b], size)
            for a, b in _PAIRS
        ]
        count = np.bincount(index, minlength=used.size)
        v = np.exp(np.bincount(index, log_v, used.size) / count)
        stacked = np.stack(sums, axis=1).astype(np.float64)
        return cls(v, stacked.reshape(len(lengths), used.size, 10))


# (0, 0) is F_n F_n, (0, 3) F_n F_t and so on
_PAIRS = [(a, b) for a in range(4) for b in range(a, 4)]
_PAIR_INDEX = np.array(  # of the products in a symmetric matrix
    [[_PAIRS.index((min(a, b), max(a, b))) for b in range(4)] for a in range(4)]
)


def solve_moments(sums: Array, v: Array, q: Array, box: Box) -> tuple[Array, Array]:
    """Return the optimal linear parameters at every q and their sums of squares.

    Args:
        sums: moments of one mixture of trials, (k, 10), or one per q, (g, k, 10).
        v: velocity of the bins [m/s], shape (k,).
        q: points (log v_s, log delta_s), shape (g, 2).
        box: bounds of the linear parameters.

    Returns:
        (mu, F_s, b), shape (g, 3), and SSE [N^2], shape (g,).
    """
    gram = np.empty((q.shape[0], 4, 4))
    for start in range(0, q.shape[0], _BLOCK):
        part = slice(start, start + _BLOCK)
        gram[part] = _gram(sums if sums.ndim == 2 else sums[part], v, q[part])
    G, c, yy = gram[:, :3, :3], gram[:, :3, 3], gram[:, 3, 3]
    p = solve_in_box(G, c, box.lower, box.upper)
    quadratic = np.einsum("gij,gj->gi", G, p)
    return p, yy + np.einsum("gi,gi->g", p, quadratic - 2.0 * c)


def _gram(sums: Array, v: Array, q: Array) -> Array:
    """Return the Gram matrix of design columns and F_t at every q, shape (g, 4, 4)."""
    e = np.log(v) - q[:, :1]
    e *= np.exp(q[:, 1:])
    e = np.exp(np.minimum(e, LARGEST_LOG_POWER, out=e), out=e)
    e = np.exp(np.negative(e, out=e), out=e)
    rest = 1.0 - e
    parts = [
        (rest * rest, slice(0, 1)),
        (rest * e, slice(1, 2)),
        (rest, slice(2, 4)),
        (e * e, slice(4, 5)),
        (e, slice(5, 7)),
    ]
    products = np.empty((q.shape[0], len(_PAIRS)))
    for weight, columns in parts:
        products[:, columns] = _weighted(weight, sums[..., columns])
    products[:, 7:] = sums[..., 7:].sum(axis=-2)
    return products[:, _PAIR_INDEX]


def _weighted(weight: Array, columns: Array) -> Array:
    """Sum columns of moments over the bins with weights (g, k), shape (g, m)."""
    if columns.ndim == 2:
        return weight @ columns
    return (weight[:, None, :] @ columns)[:, 0]


def zoom(
    sse: Callable[[Array], Array], q: Array, step: Array, logarithmic: Array
) -> Array:
    """Refine points by pattern search: move to the best neighbour, halve the step.

    Args:
        sse: sums of squares at points of shape (g, 9, 2), shape (g, 9).
        q: starting points (log v_s, log delta_s), shape (g, 2).
        step: initial steps, shape (2,).
        logarithmic: bounds of q, shape (2, 2).
    """
    for size in 0.5 ** np.arange(_ZOOMS):
        near = np.clip(q[:, None, :] + size * step * _STAR, *logarithmic.T)
        q = near[np.arange(q.shape[0]), np.argmin(sse(near), axis=1)]
    return q


def profiles(moments: Moments, box: Box, point: Point, residual: Array) -> Profiles:
    """Return the 95 % profile-likelihood intervals of v_s and delta_s.

    One of the two is fixed at 25 values and the rest minimised over. The interval holds
    the values with SSE < SSE_min (1 + chi2_95/n_eff), n_eff from the autocorrelation of
    the residual.
    """
    limit = point.sse * (1.0 + _CHI2_95 / independent_samples(residual))
    sums = moments.sums.sum(axis=0)
    ends = [_profile(sums, moments.v, box, point, k, limit) for k in (0, 1)]
    touches = any(
        abs(end - edge) < 1e-9
        for pair, edges in zip(ends, box.logarithmic, strict=True)
        for end, edge in zip(pair, edges, strict=True)
    )
    v_s, delta_s = (Interval(*(float(np.exp(end)) for end in pair)) for pair in ends)
    return Profiles(v_s, delta_s, touches)


def _profile(
    sums: Array, v: Array, box: Box, point: Point, held: int, limit: float
) -> tuple[float, float]:
    """Return the ends of the range with a profile below the limit, in logarithms."""
    (low, high), (bottom, top) = box.logarithmic[[held, 1 - held]]
    along = np.linspace(low, high, _POINTS)
    across = np.linspace(bottom, top, _ACROSS)
    grid = np.empty((_POINTS, _ACROSS, 2))
    grid[..., held], grid[..., 1 - held] = along[:, None], across
    sse = solve_moments(sums, v, grid.reshape(-1, 2), box)[1]
    kept = along[sse.reshape(_POINTS, _ACROSS).min(axis=1) < limit]
    inside = np.append(kept, point.q[held])  # always includes the optimum
    return float(inside.min()), float(inside.max())


def search(problem: Problem, moments: Moments) -> list[Point]:
    """Return the local optima reached from the best cells of a grid, best first.

    The best of the steepest curves is a further start. The starts are refined on the
    moments; those still distinct are polished on the samples.
    """
    box, sums = problem.box, moments.sums[0]
    low, high = box.logarithmic.T

    def sse(q: Array) -> Array:
        flat = solve_moments(sums, moments.v, q.reshape(-1, 2), box)[1]
        return flat.reshape(q.shape[:-1])

    axes = [np.linspace(*ends) for ends in zip(low, high, _GRID, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    step = (high - low) / (np.array(_GRID) - 1.0)
    steep = _steepest(moments.v, box)
    starts = [*_promising(grid, sse(grid)), steep[np.argmin(sse(steep))]]
    refined = zoom(sse, np.array(starts), 0.5 * step, box.logarithmic)
    optima: list[Point] = []
    for q in refined:
        if all(np.abs(q - point.q).max() > _DISTINCT for point in optima):
            optima.append(polish(problem, q, optima))
    return sorted(optima, key=lambda point: point.sse)


def _steepest(v: Array, box: Box) -> Array:
    """Return closely spaced points at the largest exponent, shape (100, 2).

    Curves close to a step have optima narrower than a grid cell, and only at velocities
    that have samples.
    """
    (low, high), (_, top) = box.logarithmic
    first, last = np.clip(np.log(v[[0, -1]]), low, high)
    along = np.linspace(first, last, _STEEP)
    return np.column_stack([along, np.full(_STEEP, top)])


def _promising(grid: Array, sse: Array) -> Array:
    """Return the best cells of a grid, no two of them neighbours, shape (4, 2)."""
    taken: list[tuple[int, int]] = []
    for flat in np.argsort(sse, axis=None).tolist():
        i, j = divmod(flat, sse.shape[1])
        if all(max(abs(i - a), abs(j - b)) > 1 for a, b in taken):
            taken.append((i, j))
        if len(taken) == _POLISHED:
            break
    return np.array([grid[index] for index in taken])


Loss = Literal["squares", "huber", "student"]

_HUBER = 1.345  # standard deviations; 95 % as efficient as squares on a normal
_NU = 4.0  # degrees of freedom of Student's t
_MAD_TO_SD = 1.4826  # of a normal
_ROUNDS = 5


def weighted(problem: Problem, loss: Loss) -> Problem:
    """Return the problem with the weights of a robust loss.

    The scale is 1.4826 times the median absolute residual. Every round updates scale
    and weights and polishes from the last optimum. The caller must run a full search on
    the result to find the optimum of the weighted problem.
    """
    point = search(problem, Moments.of(problem, (problem.F_t.size,)))[0]
    for _ in range(_ROUNDS):
        residual = problem.residual(point)
        scale = _MAD_TO_SD * float(np.median(np.abs(residual)))
        if scale <= 0:  # half of the samples are fitted exactly
            break
        problem = problem.reweighted(weigh(residual / scale, loss))
        point = polish(problem, point.q)
    return problem


def weigh(z: Array, loss: Loss) -> Array:
    """Return the weights psi(z)/z of standardised residuals z, shape (n,)."""
    if loss == "huber":
        return np.minimum(1.0, _HUBER / np.maximum(np.abs(z), _HUBER))
    if loss == "student":
        return (_NU + 1.0) / (_NU + z * z)
    return np.ones(z.size)
