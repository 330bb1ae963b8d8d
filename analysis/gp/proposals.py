"""Starting points, moves and bounds of a hyperparameter search.

The hyperparameters that a kernel declares (`Hyperparameter`) suffice to search it.
Further knowledge of where the optima of a kernel lie is registered here by its class.
"""

from collections.abc import Sequence
from functools import singledispatch
from itertools import product

import numpy as np

from analysis.data.series import Array
from analysis.gp.arcsine import Arcsine
from analysis.gp.kernels import Kernel, Product, Role, Sum

_LONGER = 3.0  # factor on the lengths of a second part; equal parts would stay equal
_STRETCHES = (0.1, 0.35, 1.0, 3.5)  # initial values of l / sd(x)
_ENDLESS = 10.0  # step in a logarithm that reaches the bound from anywhere
_LENGTHS = (-2.5, -1.2, 1.2, 2.5, _ENDLESS)  # moves of log l; the last disables it
_BIASES = (20.0, 0.05)  # initial values of beta
_SCALES = (-2.5, -1.2, 0.0, 1.2, 2.5)  # moves of log sf and all log l
_BIAS_STEPS = (-4.0, 0.0, 4.0)  # moves of log beta combined with them
_BIAS_TO_LENGTH = 2.5  # move of all log l that offsets a full sweep of the bias
# Bounds of log sf - log sd(y), log l - log sd(x), and log beta.
_SPANS = {Role.SIZE: (-6.0, 4.0), Role.LENGTH: (-4.0, 6.0), Role.BIAS: (-6.0, 6.0)}


@singledispatch
def initial_points(kernel: Kernel, sd_y: float, sd_x: Array) -> Sequence[Array]:
    """Return candidate starting points of a search, each of shape (p,).

    For any kernel: sf = sd(y)/2 with every pair of lengths.

    Args:
        kernel: kernel to search.
        sd_y: standard deviation of the outputs.
        sd_x: standard deviations of the inputs, shape (d,).
    """
    return [_point(kernel, 0.5 * sd_y, lengths, 1.0) for lengths in _length_pairs(sd_x)]


@initial_points.register
def _(kernel: Arcsine, sd_y: float, sd_x: Array) -> Sequence[Array]:
    """Return the general points, each with a large and with a small bias.

    Short lengths with a large bias and long lengths with a small one are separate
    optima.
    """
    return [
        _point(kernel, 0.5 * sd_y, lengths, bias)
        for bias in _BIASES
        for lengths in _length_pairs(sd_x)
    ]


@initial_points.register
def _(kernel: Sum, sd_y: float, sd_x: Array) -> Sequence[Array]:
    """Pair the points of both parts, the right ones with longer lengths."""
    return _paired(
        initial_points(kernel.left, sd_y, sd_x),
        initial_points(kernel.right, sd_y, _LONGER * sd_x),
    )


@initial_points.register
def _(kernel: Product, sd_y: float, sd_x: Array) -> Sequence[Array]:
    """Pair the points of both parts; the right part is dimensionless with sf = 1."""
    return _paired(
        initial_points(kernel.left, sd_y, sd_x),
        initial_points(kernel.right, 2.0, _LONGER * sd_x),
    )


@singledispatch
def moves(kernel: Kernel, theta: Array) -> Sequence[Sequence[Array]]:
    """Return points that may belong to another optimum than theta, each (p,).

    The points are grouped by kind. A search climbs in turn from the likeliest point of
    every kind that is not near an optimum already reached. For any kernel: theta with
    one length changed; the kind appears twice, so that the two likeliest are tried.
    """
    lengths = np.eye(theta.size)[_indices(kernel, Role.LENGTH)]
    changed = [theta + size * length for length in lengths for size in _LENGTHS]
    return [changed, changed]


@moves.register
def _(kernel: Arcsine, theta: Array) -> Sequence[Sequence[Array]]:
    """Return theta with another scale, with the opposite bias, or without an input.

    Where the arcsine is nearly linear, doubling the size and all lengths gives nearly
    the same function, so these are changed together and with the bias. The bias can
    offset a change of a single length, so such moves are useless. A large bias is
    combined with short lengths, a small one with long lengths.
    """
    size, *lengths, bias = np.eye(theta.size)
    every = np.sum(lengths, axis=0)
    scaled = [
        theta + a * (size + every) + b * bias
        for a, b in product(_SCALES, _BIAS_STEPS)
        if a or b
    ]
    turned = [
        theta + sign * (_ENDLESS * bias - shift * every)
        for sign in (-1.0, 1.0)
        for shift in (0.0, _BIAS_TO_LENGTH)
    ]
    unused = [
        theta + _ENDLESS * length - without * bias
        for length in lengths
        for without in (0.0, _ENDLESS)
    ]
    return [scaled, turned, unused]


@moves.register
def _(kernel: Sum | Product, theta: Array) -> Sequence[Sequence[Array]]:
    """Return the moves of each part with the other part fixed."""
    a, b = kernel.split(theta)
    of_left = [[np.concatenate([m, b]) for m in kind] for kind in moves(kernel.left, a)]
    of_right = [
        [np.concatenate([a, m]) for m in kind] for kind in moves(kernel.right, b)
    ]
    return [*of_left, *of_right]


@singledispatch
def bounds(kernel: Kernel, sd_y: float, sd_x: Array) -> Array:
    """Return the bounds of the search relative to the data, shape (p, 2)."""
    span = np.array([_SPANS[p.role] for p in kernel.parameters])
    return _point(kernel, sd_y, sd_x, 1.0)[:, None] + span


@bounds.register
def _(kernel: Sum, sd_y: float, sd_x: Array) -> Array:
    return np.vstack(
        [bounds(kernel.left, sd_y, sd_x), bounds(kernel.right, sd_y, sd_x)]
    )


@bounds.register
def _(kernel: Product, sd_y: float, sd_x: Array) -> Array:
    return np.vstack([bounds(kernel.left, sd_y, sd_x), bounds(kernel.right, 1.0, sd_x)])


def _point(kernel: Kernel, size: float, lengths: Array, bias: float) -> Array:
    """Return theta for a size, length scales of the inputs and a bias."""
    values = {Role.SIZE: np.full_like(lengths, size), Role.LENGTH: lengths}
    values[Role.BIAS] = np.full_like(lengths, bias)
    return np.log([values[p.role][p.input] for p in kernel.parameters])


def _indices(kernel: Kernel, role: Role) -> list[int]:
    return [k for k, p in enumerate(kernel.parameters) if p.role is role]


def _length_pairs(sd_x: Array) -> list[Array]:
    """Return length scales of d inputs, each of shape (d,), from rough to smooth.

    Two inputs get every pair of four lengths; further inputs repeat those alternately.
    """
    return [np.resize(pair, sd_x.size) * sd_x for pair in product(_STRETCHES, repeat=2)]


def _paired(left: Sequence[Array], right: Sequence[Array]) -> list[Array]:
    """Concatenate points pairwise; the shorter list is repeated."""
    count = max(len(left), len(right))
    return [
        np.concatenate([left[k % len(left)], right[k % len(right)]])
        for k in range(count)
    ]
