"""One climb: from a start to a top of the likelihood, or just below a known one.

By BFGS in a box. Where an approximation is good (`low_rank`), it is climbed first. Its
second derivatives are good where its values no longer are: with them the likelihood
itself is climbed to the top in some three evaluations, and on a ridge they tell a top
from a place where a climb came to stand. A climb that comes beside a known top goes on
with the second derivatives of that.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from analysis.data import Array
from analysis.gp.kernels import Kernel
from analysis.gp.likelihood import split
from analysis.gp.low_rank import Near
from analysis.gp.noise import Noise
from analysis.gp.quasi_newton import (
    Objective,
    Place,
    SearchBox,
    Start,
    Until,
    maximised,
)

_SAME_TOP = (0.2, 0.1)  # largest difference of thetas, and of likelihoods
_BESIDE = (1.0, 3.0)  # the same, for second derivatives to be alike
_REACH = 2.0  # of theta that an approximation is climbed over before it is made anew
_NEARLY = 1.0  # a shorter way needs no other approximation
_GAIN = 1e-5  # log likelihood below which a step is not worth an exact evaluation
_COARSE = 1e-3  # the same of an approximation
# twice the error that approximations aim at, and that they may have at most: on the
# way, one after the other, where starts climb them beside a top, for second derivatives
_FAIR, _GOOD, _ANY = ((0.1, 5.0),) * 3, (0.1, 0.3), (0.1, np.inf)
_DIFFERENCE = 1e-4  # of theta, for second derivatives
_SETTLED, _CURVATURES = 0.2, 3  # of theta that they are good for, and their number
_FLAT = 1e-2  # smallest second derivative that counts
_LOST = (1.0, 3, 0.05)  # below the best top, steps, and their share of what is missing


class Approximated(NamedTuple):
    """An objective with cheap approximations.

    Attributes:
        exact: theta -> likelihood and its slope; may raise SettingsError.
        near: theta, errors -> the same of an approximation around theta; None where its
            error would be too large.
    """

    exact: Objective
    near: Callable[[Array, tuple[float, float]], Objective | None]

    def __call__(self, theta: Array) -> tuple[float, Array]:
        """Return the exact likelihood and its slope."""
        return self.exact(theta)


class Top(NamedTuple):
    """What a climb reached: a top, or a place just below the top of another.

    Attributes:
        theta: hyperparameters, shape (p,).
        lml: log marginal likelihood there, priors included.
        evaluations: how often the exact likelihood was evaluated.
        bend: minus the second derivatives there, shape (p, p), roughly.
    """

    theta: Array
    lml: float
    evaluations: int
    bend: Array | None = None

    @property
    def start(self) -> Start:
        """The record of it."""
        return Start(tuple(self.theta.tolist()), self.lml, self.evaluations)


def climb(
    objective: Objective, start: Array, box: SearchBox, known: Sequence[Top]
) -> Top:
    """Return where a start ends: on a top, or just below one of those known.

    Args:
        objective: theta -> likelihood and its slope.
        start: theta to begin with.
        box: where theta is sought.
        known: what other starts have reached.
    """
    return _Climb(objective, box, known).top(np.clip(start, *box.bounds.T))


class _Climb:
    """One climb; the arguments are those of `climb`."""

    def __init__(
        self, objective: Objective, box: SearchBox, known: Sequence[Top]
    ) -> None:
        self._objective, self._box = objective, box
        self._near = objective.near if isinstance(objective, Approximated) else _none
        # what ended just below a top is none that others may end below
        self._tops = [
            top
            for k, top in enumerate(known)
            if not _top_at(top, known[:k], _SAME_TOP, is_below=True)
        ]
        self._best = max(known, key=lambda top: top.lml, default=None)
        self._passed: list[float] = []
        self._spent = 0

    def top(self, theta: Array) -> Top:
        """Return where it ends that begins at theta."""
        if self._best is not None and self._near(self._best.theta, _GOOD) is None:
            return self._climbed(theta)  # tops are rough here
        place = self._approached(theta)
        return self._climbed(theta) if place is None else self._corrected(place)

    def _climbed(self, theta: Array) -> Top:
        """Return where climbing the likelihood alone leads."""
        place = self._at(theta)
        place = self._maximised(place, lambda place: self._beside(place) is not None)
        if self._beside(place) or self._best is None or place.lml > self._best.lml:
            return self._corrected(place._replace(bend=None))
        return self._reached(place)

    def _approached(self, theta: Array) -> Place | None:
        """Return where climbing approximations leads; None where there is none."""
        found, until = None, Until(_COARSE, self._is_found)
        for error in _FAIR:
            near = self._near(theta, error)
            if near is None:
                break
            before, region = theta, self._box.around(theta, _REACH)
            place, _ = maximised(near, Place.at(near, theta), region, until)
            found, theta = place._replace(bend=None), place.theta
            if until.is_enough(place):
                break
            if np.abs(theta - before).max() < _NEARLY:
                found = _settled(near, place, region)
                break
        return None if found is None else self._at(found.theta, found.bend)

    def _corrected(self, place: Place) -> Top:
        """Return the top that a place leads to with second derivatives."""
        if place.bend is None and not self._is_below(place):
            twin = self._beside(place)
            if twin is None:
                near = self._near(place.theta, _ANY)
                bend = near and _curvature(near, place.theta, self._box)
            else:
                bend = twin.bend
            place = place._replace(bend=bend)
        return self._reached(self._maximised(place, self._is_below))

    def _maximised(self, place: Place, is_there: Callable[[Place], bool]) -> Place:
        until = Until(_GAIN, lambda place: is_there(place) or self._is_lost(place))
        place, spent = maximised(self._objective, place, self._box, until)
        self._spent += spent
        return place

    def _at(self, theta: Array, bend: Array | None = None) -> Place:
        self._spent += 1
        return Place.at(self._objective, theta, bend)

    def _reached(self, place: Place) -> Top:
        return Top(place.theta, place.lml, self._spent, place.bend)

    def _is_lost(self, place: Place) -> bool:
        """Return whether it will not reach the best known top, step by step.

        It is lost far below, where the last steps gained little of what is missing.
        """
        below, steps, share = _LOST
        self._passed.append(place.lml)
        missing = -np.inf if self._best is None else self._best.lml - place.lml
        if len(self._passed) <= steps or missing < below:
            return False
        return place.lml - self._passed[-1 - steps] < share * missing

    def _is_found(self, place: Place) -> bool:
        return _top_at(place, self._tops, _SAME_TOP) is not None

    def _is_below(self, place: Place) -> bool:
        return _top_at(place, self._tops, _SAME_TOP, is_below=True) is not None

    def _beside(self, place: Place) -> Top | None:
        top = _top_at(place, self._tops, _BESIDE)
        return None if top is None or top.bend is None else top


def _none(theta: Array, trace: tuple[float, float]) -> None:
    """Return that there is no approximation."""


def _settled(near: Objective, place: Place, box: SearchBox) -> Place:
    """Return the top of an approximation, with its second derivatives."""
    bend = None
    for _ in range(_CURVATURES):
        before = place.theta
        bend = _curvature(near, before, box)
        place, _ = maximised(near, place._replace(bend=bend), box, Until(_COARSE))
        if np.abs(place.theta - before).max() < _SETTLED:
            break
    return place._replace(bend=bend)


def _curvature(near: Objective, theta: Array, box: SearchBox) -> Array:
    """Return minus the second derivatives of an approximation, shape (p, p).

    Directions along which it is flat, or bends upwards, count as bent a little.
    """
    inwards = np.where(theta < box.bounds.mean(axis=1), _DIFFERENCE, -_DIFFERENCE)
    slope = Place.at(near, theta).slope
    rows = [
        (slope - Place.at(near, theta + step).slope) / step.sum()
        for step in np.diag(inwards)
    ]
    bends, ways = np.linalg.eigh(0.5 * (np.array(rows) + np.array(rows).T))
    return (ways * np.maximum(bends, _FLAT)) @ ways.T


def _top_at(
    place: Place | Top,
    tops: Sequence[Top],
    apart: tuple[float, float],
    *,
    is_below: bool = False,
) -> Top | None:
    """Return a top that is near, in theta and in likelihood; one above, if it has to.

    Args:
        place: where to look.
        tops: those known.
        apart: largest differences of theta and of the likelihood.
        is_below: whether the place has to be below the top.
    """
    near, low = apart
    for top in tops:
        gap = top.lml - place.lml
        is_near = abs(gap) < low and np.abs(place.theta - top.theta).max() < near
        if is_near and (gap >= 0.0 or not is_below):
            return top
    return None


def objective_of(
    model: tuple[Kernel, Noise], likelihood: Objective, near: Near
) -> Approximated:
    """Return what is climbed: the likelihood times the noise's prior.

    Args:
        model: kernel and noise.
        likelihood: the exact one.
        near: its approximations.
    """
    made: dict[tuple[bytes, tuple[float, float]], Objective | None] = {}

    def near_with_prior(theta: Array, trace: tuple[float, float]) -> Objective | None:
        key = theta.tobytes(), trace
        if key not in made:
            found = near(theta, trace)
            made[key] = None if found is None else _with_prior(model, found)
        return made[key]

    return Approximated(_with_prior(model, likelihood), near_with_prior)


def _with_prior(model: tuple[Kernel, Noise], likelihood: Objective) -> Objective:
    """Return the likelihood with the noise's prior, and its slope."""
    kernel, noise = model

    def objective(theta: Array) -> tuple[float, Array]:
        lml, slope = likelihood(theta)
        prior, prior_slope = noise.log_prior(split(kernel, theta)[1])
        slope[-prior_slope.size :] += prior_slope
        return lml + prior, slope

    return objective
