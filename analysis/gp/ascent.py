"""One climb: from a start to a top of the likelihood, or just below a known one.

By BFGS in a box. Where an approximation is good (`approach`), it is climbed first, and
that is all where other starts lead higher. Only what may be the best top is climbed to
the end: with the approximation's second derivatives, in one step or two. These also
tell a top from a place on a ridge where a climb came to stand. A climb that comes
beside a known top goes on with the second derivatives of that.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from acquisition.errors import SettingsError
from analysis.data.series import Array
from analysis.gp.approach import (
    ANY,
    GOOD,
    Approach,
    Approximated,
    approached,
    curvature,
    settled,
)
from analysis.gp.quasi_newton import (
    Objective,
    Place,
    SearchBox,
    Until,
    maximised,
    newton_step,
)

_SAME_TOP = (0.2, 0.1)  # largest difference of thetas, and of likelihoods
_BESIDE = (1.0, 3.0)  # the same, for second derivatives to be alike
_GAIN = 1e-5  # log likelihood below which a step is not worth an exact evaluation
_LAST = 2e-3  # below which a step that keeps its promise is the last one
_KEPT = 0.3  # largest difference of a gain from its promise, in shares of it
_HOPEFUL = 4.0  # log likelihood below the best top, on the way: it may be on a ridge
_RIVAL = 0.5  # the same at an approximation's top: it may still become the best
_FIRM = 0.3  # smallest second derivative of a top that is no ridge
_LOST = (1.0, 3, 0.05)  # below the best top, steps, and their share of what is missing


class Start(NamedTuple):
    """One start of a search and what it reached.

    Attributes:
        theta: hyperparameters at its end: a top, or just below the top of another.
        lml: log marginal likelihood there, priors included.
        evaluations: how often the exact likelihood was evaluated; where it never was,
            `lml` is that of an approximation, and another start reached more.
    """

    theta: tuple[float, ...]
    lml: float
    evaluations: int


class Top(NamedTuple):
    """What a climb reached: a top, or a place just below the top of another.

    Attributes:
        theta: hyperparameters, shape (p,).
        lml: log marginal likelihood there, priors included.
        evaluations: how often the exact likelihood was evaluated.
        bend: minus the second derivatives there, shape (p, p), roughly.
        approach: how it was reached, where it is the top of an approximation only and
            `lml` the value of that.
    """

    theta: Array
    lml: float
    evaluations: int
    bend: Array | None = None
    approach: Approach | None = None

    @classmethod
    def of(cls, approach: Approach) -> "Top":
        """Return the top of an approximation."""
        place = approach.place
        return cls(place.theta, place.lml, 0, place.bend, approach)

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


def refined(objective: Objective, box: SearchBox, tops: Sequence[Top]) -> list[Top]:
    """Return tops, those of approximations that may be the best climbed to the end.

    Args:
        objective: theta -> likelihood and its slope.
        box: where theta is sought.
        tops: what starts have reached.
    """
    ends = list(tops)
    for k in np.argsort([-top.lml for top in tops], kind="stable").tolist():
        approach, exact = ends[k].approach, [top for top in ends if not top.approach]
        best = max((top.lml for top in exact), default=-np.inf)
        if approach is None or ends[k].lml < best - _HOPEFUL:
            continue
        if _top_at(ends[k], exact, _SAME_TOP, is_below=True) is None:
            ends[k] = _Climb(objective, box, exact).end(approach)
    return ends


class _Climb:
    """One climb; the arguments are those of `climb`."""

    def __init__(
        self, objective: Objective, box: SearchBox, known: Sequence[Top]
    ) -> None:
        self._objective, self._box = _approximated(objective), box
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
        if self._best is not None and self._is_rough(self._best):
            return self._climbed(theta)
        approach = approached(self._objective, theta, self._box, self._is_found)
        if approach is None:
            return self._climbed(theta)
        place = approach.place
        if self._is_found(place) or approach.is_good():
            return Top.of(approach)
        near = self._objective.near(place.theta, GOOD)
        if near is not None:
            return Top.of(Approach(Place.at(near, place.theta, place.bend), near))
        return self._corrected(self._at(place.theta))

    def end(self, approach: Approach) -> Top:
        """Return the top that an approach leads to.

        That of the approximation, where it is firm and too low to be the best.
        """
        place = settled(approach, self._box)
        is_low = self._best is not None and place.lml < self._best.lml - _RIVAL
        if is_low and self._is_firm(place):
            return Top.of(Approach(place, approach.near))
        return self._corrected(self._at(place.theta, place.bend))

    def _is_rough(self, top: Top) -> bool:
        """Return whether no approximation is good at a top."""
        return not top.approach and self._objective.near(top.theta, GOOD) is None

    def _is_firm(self, place: Place) -> bool:
        """Return whether a place is on a top by second derivatives, not on a ridge."""
        low, high = self._box.bounds.T
        is_free = (place.theta > low) & (place.theta < high)
        if place.bend is None or not is_free.any():
            return False
        bends = np.linalg.eigvalsh(place.bend[np.ix_(is_free, is_free)])
        return float(bends[0]) > _FIRM

    def _climbed(self, theta: Array) -> Top:
        """Return where climbing the likelihood alone leads."""
        place = self._at(theta)
        place = self._maximised(place, lambda place: self._beside(place) is not None)
        if self._beside(place) or self._best is None or place.lml > self._best.lml:
            return self._corrected(place._replace(bend=None))
        return self._reached(place)

    def _corrected(self, place: Place) -> Top:
        """Return the top that a place leads to with second derivatives."""
        if place.bend is None and not self._is_below(place):
            place = place._replace(bend=self._bend_at(place))
        if self._is_firm(place):
            place = self._maximised(place, self._is_below, _LAST)
            last = None if self._is_below(place) else self._last_step(place)
            if last is not None:
                return self._reached(last)
        return self._reached(self._maximised(place, self._is_below))

    def _bend_at(self, place: Place) -> Array | None:
        """Return minus the second derivatives, of a top beside or an approximation."""
        twin = self._beside(place)
        if twin is not None:
            return twin.bend
        near = self._objective.near(place.theta, ANY)
        if near is None:
            return None
        return curvature(near, Place.at(near, place.theta), self._box)

    def _last_step(self, place: Place) -> Place | None:
        """Return where a step leads that promises little and keeps it.

        Its slope is not evaluated, and remains that of before. None where the step
        promises more, or gains less or more than that: it bends otherwise there.
        """
        end, gain = newton_step(place, self._box)
        if not _GAIN < gain < _LAST:
            return None
        self._spent += 1
        try:
            lml = float(self._objective.value(end))
        except SettingsError:
            return None
        is_kept = abs(lml - place.lml - gain) < _KEPT * gain
        return place._replace(theta=end, lml=lml) if is_kept else None

    def _maximised(
        self, place: Place, is_there: Callable[[Place], bool], gain: float = _GAIN
    ) -> Place:
        until = Until(gain, lambda place: is_there(place) or self._is_lost(place))
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


def _approximated(objective: Objective) -> Approximated:
    """Return an objective with its approximations; there are none of a plain one."""
    if isinstance(objective, Approximated):
        return objective
    return Approximated(
        objective, lambda theta: objective(theta)[0], lambda theta, trace: None
    )


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
