"""The way to a top by approximations of the likelihood, which cost a fifth of it.

An approximation is made around a place. It is climbed until that is left far behind,
then another one is made there. At its top its second derivatives are taken by
differences of its slope: they are good where its values no longer are.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from acquisition.errors import SettingsError
from analysis.data.series import Array
from analysis.gp.kernels import Kernel
from analysis.gp.likelihood import Likelihood, split
from analysis.gp.low_rank import LowRankLikelihood, Near
from analysis.gp.noise import Noise
from analysis.gp.quasi_newton import Objective, Place, SearchBox, Until, maximised

GOOD = (0.1, 0.3)  # t that an approximation aims at, and that it may have at most
ANY = (0.1, np.inf)  # the same for second derivatives

_FAIR = ((0.1, 5.0),) * 3  # the same on the way, one approximation after the other
_REACH = 2.0  # of theta that an approximation is climbed over before it is made anew
_NEARLY = 1.0  # a shorter way needs no other approximation
_COARSE = 1e-3  # log likelihood below which a step on the way is not worth its cost
_DIFFERENCE = 1e-4  # of theta, for second derivatives
_SETTLED, _CURVATURES = 0.2, 3  # of theta that they are good for, and their number
_FLAT = 1e-2  # smallest second derivative that counts


class Approximation(Protocol):
    """A likelihood that is good around a place."""

    def __call__(self, theta: Array) -> tuple[float, Array]:
        """Return it and its slope."""
        ...

    def value(self, theta: Array) -> tuple[float, float]:
        """Return it alone, and twice the error it may have."""
        ...


class Approximated(NamedTuple):
    """An objective with cheap approximations.

    Attributes:
        exact: theta -> likelihood and its slope; may raise SettingsError.
        value: theta -> the likelihood alone; may raise SettingsError.
        near: theta, errors -> an approximation around theta; None where its error would
            be too large.
    """

    exact: Objective
    value: Callable[[Array], float]
    near: Callable[[Array, tuple[float, float]], Approximation | None]

    def __call__(self, theta: Array) -> tuple[float, Array]:
        """Return the exact likelihood and its slope."""
        return self.exact(theta)


class Approach(NamedTuple):
    """Where climbing approximations has led.

    Attributes:
        place: where the last of them was climbed to, next to its top.
        near: that approximation.
    """

    place: Place
    near: Approximation

    def is_good(self) -> bool:
        """Return whether the approximation is good at the place."""
        try:
            return self.near.value(self.place.theta)[1] < GOOD[1]
        except SettingsError:
            return False


def approached(
    objective: Approximated,
    theta: Array,
    box: SearchBox,
    is_found: Callable[[Place], bool],
) -> Approach | None:
    """Return where climbing approximations leads; None where there is none.

    Args:
        objective: what makes them.
        theta: to begin with.
        box: where theta is sought.
        is_found: place -> whether the way may end there.
    """
    approach, until = None, Until(_COARSE, is_found)
    for error in _FAIR:
        near = objective.near(theta, error)
        if near is None:
            break
        region = box.around(theta, _REACH)
        place, _ = maximised(near, Place.at(near, theta), region, until)
        approach = Approach(place, near)
        way = float(np.abs(place.theta - theta).max())
        if way < _NEARLY or is_found(place):
            break
        theta = place.theta
    return approach


def settled(approach: Approach, box: SearchBox) -> Place:
    """Return the top of an approximation, with its second derivatives."""
    place, near, bend = approach.place, approach.near, None
    region = box.around(place.theta, _REACH)
    for _ in range(_CURVATURES):
        before = place.theta
        bend = curvature(near, place, region)
        place, _ = maximised(near, place._replace(bend=bend), region, Until(_COARSE))
        if np.abs(place.theta - before).max() < _SETTLED:
            break
    return place._replace(bend=bend)


def curvature(near: Objective, place: Place, box: SearchBox) -> Array:
    """Return minus the second derivatives of an approximation, shape (p, p).

    Directions along which it is flat, or bends upwards, count as bent a little.
    """
    theta, slope = place.theta, place.slope
    inwards = np.where(theta < box.bounds.mean(axis=1), _DIFFERENCE, -_DIFFERENCE)
    rows = [
        (slope - Place.at(near, theta + step).slope) / step.sum()
        for step in np.diag(inwards)
    ]
    bends, ways = np.linalg.eigh(0.5 * (np.array(rows) + np.array(rows).T))
    return (ways * np.maximum(bends, _FLAT)) @ ways.T


def objective_of(likelihood: Likelihood, near: Near) -> Approximated:
    """Return what is climbed: the likelihood times the noise's prior.

    Args:
        likelihood: the exact one.
        near: its approximations.
    """
    prior = _Prior(likelihood.model)

    def made(theta: Array, trace: tuple[float, float]) -> Approximation | None:
        found = near(theta, trace)
        return None if found is None else _WithPrior(found, prior)

    return Approximated(
        lambda theta: prior.added(theta, likelihood(theta)),
        lambda theta: likelihood.value(theta) + prior.at(theta)[0],
        made,
    )


@dataclass(frozen=True, slots=True)
class _Prior:
    """The prior of a model's noise: kernel and noise."""

    model: tuple[Kernel, Noise]

    def at(self, theta: Array) -> tuple[float, Array]:
        """Return it and its slope in the noise's part of theta."""
        kernel, noise = self.model
        return noise.log_prior(split(kernel, theta)[1])

    def added(self, theta: Array, found: tuple[float, Array]) -> tuple[float, Array]:
        """Return a likelihood and its slope with it; the slope is overwritten."""
        (lml, slope), (prior, prior_slope) = found, self.at(theta)
        slope[-prior_slope.size :] += prior_slope
        return lml + prior, slope


@dataclass(frozen=True, slots=True)
class _WithPrior:
    """An approximation of the likelihood, with the noise's prior."""

    likelihood: LowRankLikelihood
    prior: _Prior

    def __call__(self, theta: Array) -> tuple[float, Array]:
        """Return it and its slope."""
        return self.prior.added(theta, self.likelihood(theta))

    def value(self, theta: Array) -> tuple[float, float]:
        """Return it alone, and twice the error it may have."""
        lml, left = self.likelihood.value(theta)
        return lml + self.prior.at(theta)[0], left
