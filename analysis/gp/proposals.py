"""Where a search of hyperparameters begins, where it may jump, and its bounds.

A kernel says which hyperparameters it has (`Hyperparameter`), and that is enough to
search it. What more is known of where the tops of a kernel lie is registered here, by
its class.
"""

from collections.abc import Sequence
from functools import singledispatch
from itertools import product

import numpy as np

from analysis.data.series import Array
from analysis.gp.arcsine import Arcsine
from analysis.gp.kernels import Kernel, Product, Role, Sum

_LONGER = 3.0  # are the lengths of a second part, or equal parts would stay equal
_STRETCHES = (0.1, 0.35, 1.0, 3.5)  # l / sd(x) that a search may start with
_ENDLESS = 10.0  # more in a logarithm than a search goes: to its bound
_LENGTHS = (-2.5, -1.2, 1.2, 2.5, _ENDLESS)  # moves of log l; the last: not used
_BIASES = (20.0, 0.05)  # beta that a search may start with
_SCALES = (-2.5, -1.2, 0.0, 1.2, 2.5)  # moves of log sf and all log l
_BIAS_STEPS = (-4.0, 0.0, 4.0)  # moves of log beta that go with them
_BIAS_TO_LENGTH = 2.5  # move of all log l that makes up for the bias from end to end
# Of log sf - log sd(y), log l - log sd(x), and log beta.
_SPANS = {Role.SIZE: (-6.0, 4.0), Role.LENGTH: (-4.0, 6.0), Role.BIAS: (-6.0, 6.0)}


@singledispatch
def initial_points(kernel: Kernel, sd_y: float, sd_x: Array) -> Sequence[Array]:
    """Return points that a search may start with, each of shape (p,).

    Of any kernel: sf = sd(y)/2 with every pair of lengths, and no other scale.

    Args:
        kernel: whose hyperparameters are sought.
        sd_y: standard deviation of the outputs.
        sd_x: of the inputs, shape (d,).
    """
    return [_point(kernel, 0.5 * sd_y, lengths, 1.0) for lengths in _length_pairs(sd_x)]


@initial_points.register
def _(kernel: Arcsine, sd_y: float, sd_x: Array) -> Sequence[Array]:
    """Return those of any kernel, with a large bias and with a small one.

    Short lengths with a large bias, and long ones with next to none, are optima of
    their own.
    """
    return [
        _point(kernel, 0.5 * sd_y, lengths, bias)
        for bias in _BIASES
        for lengths in _length_pairs(sd_x)
    ]


@initial_points.register
def _(kernel: Sum, sd_y: float, sd_x: Array) -> Sequence[Array]:
    """Return those of both parts alongside, the right ones with longer lengths."""
    return _alongside(
        initial_points(kernel.left, sd_y, sd_x),
        initial_points(kernel.right, sd_y, _LONGER * sd_x),
    )


@initial_points.register
def _(kernel: Product, sd_y: float, sd_x: Array) -> Sequence[Array]:
    """Return those of both; the right part is dimensionless with sf = 1."""
    return _alongside(
        initial_points(kernel.left, sd_y, sd_x),
        initial_points(kernel.right, 2.0, _LONGER * sd_x),
    )


@singledispatch
def moves(kernel: Kernel, theta: Array) -> Sequence[Sequence[Array]]:
    """Return points that may belong to another top than theta, each (p,).

    They come in kinds. A search climbs from the likeliest of every kind in turn, of
    those that are not near to what it has reached by then. Of any kernel: theta with
    one length changed, twice, so that the two likeliest are taken.
    """
    lengths = np.eye(theta.size)[_indices(kernel, Role.LENGTH)]
    changed = [theta + size * length for length in lengths for size in _LENGTHS]
    return [changed, changed]


@moves.register
def _(kernel: Arcsine, theta: Array) -> Sequence[Sequence[Array]]:
    """Return theta with another scale, the other end of bias, an input not used.

    Where the arcsine is nearly linear, twice the size with twice the lengths is nearly
    the same function: these change together, and with the bias. The bias makes up for
    a single length that changes, so no such move leads far. Much bias goes with short
    lengths, none of it with long ones.
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
    """Return the moves of one part while the other stays."""
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
    """Return theta with this size, these lengths of the inputs and this bias."""
    values = {Role.SIZE: np.full_like(lengths, size), Role.LENGTH: lengths}
    values[Role.BIAS] = np.full_like(lengths, bias)
    return np.log([values[p.role][p.input] for p in kernel.parameters])


def _indices(kernel: Kernel, role: Role) -> list[int]:
    return [k for k, p in enumerate(kernel.parameters) if p.role is role]


def _length_pairs(sd_x: Array) -> list[Array]:
    """Return lengths of d inputs, each of shape (d,), from rough to smooth.

    Two inputs get every pair of four lengths; further ones take turns with these two.
    """
    return [np.resize(pair, sd_x.size) * sd_x for pair in product(_STRETCHES, repeat=2)]


def _alongside(left: Sequence[Array], right: Sequence[Array]) -> list[Array]:
    """Return pairs of points; those of the shorter list are used again."""
    count = max(len(left), len(right))
    return [
        np.concatenate([left[k % len(left)], right[k % len(right)]])
        for k in range(count)
    ]
