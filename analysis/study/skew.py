"""Distributions that are not symmetric: a warp of the force, a shape of its score.

The warp z = c log(y + c) makes forces on stones, which have a long tail upwards and
next to none downwards, nearly normal (Snelson, Rasmussen and Ghahramani 2003). It is a
straight line for c far above the forces.

A shape turns the normal score x of a measurement into another one,
S(x) = sinh(delta asinh((x - xi) / eta) - epsilon), which is normal again where x is not
(Jones and Pewsey 2009).
"""

from collections.abc import Sequence
from typing import NamedTuple, TypeVar

import numpy as np

from analysis.data.series import Array

_CLIPPED = 0.95  # c times this below zero, where the warp would lose its logarithm
_MOST_CLIPPED = 0.5  # share of the forces
_STEEPEST = 50.0  # z / c beyond which an exponential is no force any more
_BOX = ((-1.0, 1.0), (-0.7, 0.7), (-1.0, 1.0), (-0.7, 0.7))  # of a shape
_RIDGE = 0.005  # half a prior's precision over the number of rows

_Bend = TypeVar("_Bend", float, float | None)


class ShapeMap(NamedTuple):
    """S(x) = sinh(delta asinh((x - xi) / eta) - epsilon), increasing.

    Attributes:
        xi: shift of the normal score.
        log_eta: logarithm of its scale.
        epsilon: skew; above 0 the predicted distribution leans to large forces.
        log_delta: logarithm of its tails: below 0 they are heavier than a normal's.
    """

    xi: float = 0.0
    log_eta: float = 0.0
    epsilon: float = 0.0
    log_delta: float = 0.0

    def score(self, x: Array) -> Array:
        """Return S(x)."""
        return np.sinh(self._inner(x))

    def inverse(self, score: Array) -> Array:
        """Return x of S(x) = score."""
        bent = (np.arcsinh(score) + self.epsilon) / np.exp(self.log_delta)
        return self.xi + np.exp(self.log_eta) * np.sinh(bent)

    def log_gain(self, x: Array) -> Array:
        """Return by how much the log density changes where the score was x."""
        return self.gain_and_slopes(x)[0]

    def gain_and_slopes(self, x: Array) -> tuple[Array, Array]:
        """Return the gain, and its slopes in (xi, log eta, epsilon, log delta), (4, n).

        With f = (x - xi) / eta, I = delta asinh f - epsilon and S = sinh I it is
        (x^2 - S^2)/2 + log dS/dx, and dS/dx = cosh I delta / (eta sqrt(1 + f^2)).
        """
        eta, delta = np.exp(self.log_eta), np.exp(self.log_delta)
        far = (x - self.xi) / eta
        root, inner = np.sqrt(1.0 + far * far), self._inner(x)
        score, steep = np.sinh(inner), np.cosh(inner)
        gain = 0.5 * (x * x - score * score) + np.log(steep / root)
        of_inner, share = score / steep - score * steep, far / root
        of_far = delta * of_inner / root - share / root
        slopes = [-of_far / eta, -of_far * far - 1.0, -of_inner]
        slopes.append((inner + self.epsilon) * of_inner + 1.0)
        return gain + self.log_delta - self.log_eta, np.stack(slopes)

    def _inner(self, x: Array) -> Array:
        far = (x - self.xi) / np.exp(self.log_eta)
        return np.exp(self.log_delta) * np.arcsinh(far) - self.epsilon


def warped(F_t: Array, c: float | None) -> Array:
    """Return z = c log(y + c), the forces below -0.95 c put there; None: as they are.

    Args:
        F_t: forces y [N].
        c: where the logarithm bends [N].
    """
    return F_t if c is None else c * np.log(np.maximum(F_t, deepest(c)) + c)


def deepest(c: float | None) -> float:
    """Return the force [N] below which a warp is clipped."""
    return -np.inf if c is None else -_CLIPPED * c


def bends_for(F_t: Array, bends: Sequence[_Bend]) -> list[_Bend]:
    """Return those of `bends` whose warp leaves most of the forces as they are.

    Forces of the other sign would all be clipped to the same one.
    """
    return [c for c in bends if np.mean(F_t < deepest(c)) < _MOST_CLIPPED]


def unwarped(z: Array, c: float | None) -> Array:
    """Return y = exp(z / c) - c [N]."""
    return z if c is None else np.exp(np.minimum(z / c, _STEEPEST)) - c


def log_warp_slope(F_t: Array, c: float | None) -> Array:
    """Return log dz/dy = log(c / (y + c)), 0 without a warp."""
    if c is None:
        return np.zeros(F_t.shape)
    return np.log(c / (np.maximum(F_t, deepest(c)) + c))


def choose_shape(scores: Sequence[Array]) -> tuple[ShapeMap | None, float]:
    """Return a shape if it raises the density of trials that it was not fitted to.

    Args:
        scores: normal scores of the rows of every trial left out.
    """
    count = len(scores)
    if count < 3:
        return None, 0.0
    whole = _fitted_shape(scores)
    gains = np.array(
        [
            float(
                _fitted_shape([*scores[:k], *scores[k + 1 :]], whole).log_gain(x).mean()
            )
            for k, x in enumerate(scores)
        ]
    )
    gain, error = float(gains.mean()), float(gains.std(ddof=1) / np.sqrt(count))
    return (whole if gain > error else None), gain


def _fitted_shape(scores: Sequence[Array], start: ShapeMap | None = None) -> ShapeMap:
    """Return the shape of largest likelihood, each trial with the same weight."""
    from scipy.optimize import minimize

    x = np.concatenate(scores)
    weight = np.concatenate([np.full(part.size, 1.0 / part.size) for part in scores])
    weight /= weight.sum()

    def cost(theta: Array) -> tuple[float, Array]:
        gain, slopes = ShapeMap(*theta).gain_and_slopes(x)
        ridge = _RIDGE * float(theta @ theta)
        return ridge - float(weight @ gain), 2.0 * _RIDGE * theta - slopes @ weight

    optimum = minimize(
        cost, start or np.zeros(4), jac=True, method="L-BFGS-B", bounds=_BOX
    )
    return ShapeMap(*(float(value) for value in optimum.x))
