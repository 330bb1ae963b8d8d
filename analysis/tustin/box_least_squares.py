"""Least squares with three parameters in a box, solved exactly and in bulk.

With Gram matrix G = A'A and c = A'y the sum of squares is y'y - 2 c'p + p'Gp, a convex
quadratic. Where its stationary point lies in the box, that is the minimum. Otherwise
the minimum lies on one of the bounds that the stationary point violates: from a point
inside all of those the cost would still fall on the way to the stationary point. With
one parameter held at such a bound the same holds of the two others. So one of the six
orders in which parameters are held, each where its violated bound is, leads to the
minimum; every order gives a point of the box, and the best of them is taken.
"""

from itertools import permutations

import numpy as np

from analysis.data.series import Array

# relative; keeps collinear columns solvable. The tiny part does that for zero ones
_RIDGE = 1.0 + 1e-12 * np.eye(3)
_TINY = np.finfo(np.float64).tiny * np.eye(3)
_ORDERS = np.array(list(permutations(range(3))))  # (6, 3)
_INVERSE_ORDERS = np.argsort(_ORDERS, axis=1)  # where each parameter is in an order


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
    ridged = G * _RIDGE + _TINY
    p = _stationary(ridged, c)
    is_outside = ((p < lower) | (p > upper)).any(axis=-1)
    if is_outside.any():
        held = np.minimum(np.maximum(p[is_outside], lower), upper)
        p[is_outside] = _on_a_bound(
            ridged[is_outside], c[is_outside], held, lower, upper
        )
    return p


def _stationary(G: Array, c: Array) -> Array:
    """Return the solution of G p = c, shape (..., 3), by elimination without pivots."""
    a, b, d = G[..., 0, 0], G[..., 0, 1], G[..., 0, 2]
    first, second = b / a, d / a
    e = G[..., 1, 1] - first * b
    f = G[..., 1, 2] - first * d
    third = f / e
    y = c[..., 1] - first * c[..., 0]
    z = c[..., 2] - second * c[..., 0] - third * y
    p = np.empty(c.shape)
    p[..., 2] = r = z / (G[..., 2, 2] - second * d - third * f)
    p[..., 1] = q = (y - f * r) / e
    p[..., 0] = (c[..., 0] - b * q - d * r) / a
    return p


def _on_a_bound(G: Array, c: Array, held: Array, low: Array, high: Array) -> Array:
    """Return the minimum where the stationary point is outside, shape (m, 3).

    Args:
        G: Gram matrices, shape (m, 3, 3).
        c: right-hand sides, shape (m, 3).
        held: stationary points clipped into the box, shape (m, 3).
        low: lower bounds, shape (3,).
        high: upper bounds, shape (3,).
    """
    i, j, k = _ORDERS.T
    G_jj, G_jk, G_kk = G[:, j, j], G[:, j, k], G[:, k, k]
    p_i = held[:, i]
    c_j, c_k = c[:, j] - G[:, i, j] * p_i, c[:, k] - G[:, i, k] * p_i
    ratio = G_jk / G_kk
    p_j = (c_j - ratio * c_k) / (G_jj - ratio * G_jk)
    p_j = np.minimum(np.maximum(p_j, low[j]), high[j])
    p_k = (c_k - G_jk * p_j) / G_kk
    p_k = np.minimum(np.maximum(p_k, low[k]), high[k])
    cost = p_i * (G[:, i, i] * p_i - 2.0 * c[:, i])
    cost += p_j * (G_jj * p_j + 2.0 * (G_jk * p_k - c_j))
    cost += p_k * (G_kk * p_k - 2.0 * c_k)
    best, rows = np.argmin(cost, axis=1), np.arange(c.shape[0])
    ordered = np.stack([p_i, p_j, p_k], axis=-1)[rows, best]
    return np.take_along_axis(ordered, _INVERSE_ORDERS[best], axis=1)
