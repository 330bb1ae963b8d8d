"""Least squares with three parameters in a box, solved exactly and in bulk.

With Gram matrix G = A'A and c = A'y the sum of squares is y'y - 2 c'p + p'Gp, a convex
quadratic. Where its stationary point lies in the box, that is the minimum. Otherwise
every parameter is free, at its lower or at its upper bound: 27 cases, each a 3x3 linear
system. Every case is solved, clipped into the box and scored; the best score is the
minimum, because the true one is among the cases and none can be below it.
"""

from itertools import product

import numpy as np

from analysis.data import Array

RIDGE = 1e-12  # relative; keeps collinear columns solvable
_FREE = 0
_CASES = np.array(list(product((_FREE, -1, 1), repeat=3)))  # (27, 3)


def solve_in_box(G: Array, c: Array, lower: Array, upper: Array) -> Array:
    """Return the p in [lower, upper] that minimises p'Gp - 2 c'p.

    Args:
        G: Gram matrices, shape (..., 3, 3).
        c: right-hand sides, shape (..., 3).
        lower: lower bounds, shape (3,).
        upper: upper bounds, shape (3,).

    Returns:
        Parameters, shape (..., 3).
    """
    scale = np.sqrt(np.einsum("...ii->...i", G))
    scale = np.where(scale > 0, scale, 1.0)
    scaled = G / (scale[..., :, None] * scale[..., None, :]) + RIDGE * np.eye(3)
    right = c / scale
    free = np.linalg.solve(scaled, right[..., None])[..., 0] / scale
    is_outside = ((free < lower) | (free > upper)).any(axis=-1)
    # the cost is convex: a stationary point inside the box is its minimum
    if is_outside.any():
        free[is_outside] = _on_the_edge(
            (G[is_outside], c[is_outside]),
            (scaled[is_outside], right[is_outside]),
            scale[is_outside],
            (lower, upper),
        )
    return free


def _on_the_edge(
    plain: tuple[Array, Array],
    scaled: tuple[Array, Array],
    scale: Array,
    box: tuple[Array, Array],
) -> Array:
    """Return the best of all 27 cases, shape (..., 3)."""
    (G, c), (lower, upper) = plain, box
    candidates = _solve_cases(*scaled, scale, box) / scale[..., None, :]
    candidates = np.clip(candidates, lower, upper)
    cost = np.einsum("...ki,...ij,...kj->...k", candidates, G, candidates)
    cost -= 2.0 * np.einsum("...ki,...i->...k", candidates, c)
    best = np.argmin(cost, axis=-1)[..., None, None]
    return np.take_along_axis(candidates, best, axis=-2)[..., 0, :]


def _solve_cases(G: Array, c: Array, scale: Array, box: tuple[Array, Array]) -> Array:
    """Return the stationary point of every case in scaled units, shape (..., 27, 3).

    A parameter at a bound has its equation replaced by p_i = bound.
    """
    is_free = _CASES == _FREE
    bound = np.where(_CASES < 0, box[0], box[1]) * scale[..., None, :]
    system = np.where(is_free[:, :, None], G[..., None, :, :], np.eye(3))
    right = np.where(is_free, c[..., None, :], bound)
    return np.linalg.solve(system, right[..., None])[..., 0]
