"""Box-constrained least squares with three parameters, exact and vectorised.

With Gram matrix G = A'A and c = A'y the sum of squares is y'y - 2 c'p + p'Gp, a convex
quadratic. If its stationary point lies in the box, that is the minimum. Otherwise the
minimum lies on one of the bounds that the stationary point violates: from a point
strictly inside all of those, the cost still decreases towards the stationary point.
With one parameter fixed at such a bound the same argument applies to the other two. So
one of the six orders of fixing parameters at their violated bounds leads to the
minimum. Every order gives a feasible point, and the best of the six is taken.
"""

from itertools import permutations

import numpy as np

from analysis.data.series import Array

# The relative ridge keeps collinear columns solvable, the tiny one zero columns.
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
        clipped = np.minimum(np.maximum(p[is_outside], lower), upper)
        p[is_outside] = _bound_minimum(
            ridged[is_outside], c[is_outside], clipped, lower, upper
        )
    return p


def _stationary(G: Array, c: Array) -> Array:
    """Solve G p = c by elimination without pivoting, shape (..., 3)."""
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


def _bound_minimum(
    G: Array, c: Array, clipped: Array, low: Array, high: Array
) -> Array:
    """Return the constrained minimum for stationary points outside the box, (m, 3).

    Args:
        G: Gram matrices, shape (m, 3, 3).
        c: right-hand sides, shape (m, 3).
        clipped: stationary points clipped to the box, shape (m, 3).
        low: lower bounds, shape (3,).
        high: upper bounds, shape (3,).
    """
    i, j, k = _ORDERS.T
    G_jj, G_jk, G_kk = G[:, j, j], G[:, j, k], G[:, k, k]
    p_i = clipped[:, i]
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
