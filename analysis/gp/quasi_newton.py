"""The top that a start leads to by BFGS in a box.

An objective has few parameters and costs a thousand times what a step costs, so minus
its second derivatives are kept as a matrix (Nocedal and Wright 2006, algorithm 18.2 for
the damping, which keeps it positive definite where the objective bends upwards). A
climb has ended where the parabola promises next to nothing. One that begins with good
second derivatives needs three or four evaluations.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from acquisition.errors import SettingsError
from analysis.data.series import Array
from analysis.gp.likelihood import lapack

# theta -> value and slope; may raise SettingsError
Objective = Callable[[Array], tuple[float, Array]]

HOPELESS = 1e25  # minus the value where no jitter helps

_STEEP = 5.0  # second derivatives to begin with, times the steps' squares
_REACH = 1.0  # longest step
_MOST = 200  # steps of a climb, and
_HALVINGS = 12  # evaluations of one
_ARMIJO = 1e-4  # share of the promised rise that a step has to keep
_SHORTER = (0.1, 0.6)  # a step that does not is shortened to
_DAMPED = 0.2  # smallest share of its curvature that one step leaves of a direction
_RESCALED = (0.2, 20.0)  # by what the first step teaches


class Place(NamedTuple):
    """Where a climb stands.

    Attributes:
        theta: hyperparameters, shape (p,).
        lml: the objective there.
        slope: its slope, shape (p,).
        bend: minus its second derivatives, shape (p, p), positive definite; None where
            nothing is known of them.
    """

    theta: Array
    lml: float
    slope: Array
    bend: Array | None = None

    @classmethod
    def at(
        cls, objective: Objective, theta: Array, bend: Array | None = None
    ) -> "Place":
        """Return a place; hopeless where the covariance cannot be factorised."""
        try:
            lml, slope = objective(theta)
        except SettingsError:
            return cls(theta, -HOPELESS, np.zeros_like(theta), bend)
        return cls(theta, float(lml), slope, bend)


class SearchBox(NamedTuple):
    """Where theta is sought.

    Attributes:
        bounds: of theta, shape (p, 2).
        steps: size of its steps, shape (p,).
    """

    bounds: Array
    steps: Array

    def around(self, theta: Array, reach: float) -> "SearchBox":
        """Return the part of the box that is no further than `reach` from theta."""
        low, high = np.clip([theta - reach, theta + reach], *self.bounds.T)
        return self._replace(bounds=np.column_stack([low, high]))


class Until(NamedTuple):
    """What ends a climb.

    Attributes:
        gain: that the parabola promises less than.
        is_enough: place -> whether it ends there at once.
    """

    gain: float
    is_enough: Callable[[Place], bool] = lambda place: False


class _Parabola:
    """An objective around a place, and the way to its top in a box.

    Args:
        box: where theta is sought.
        bend: minus the second derivatives to begin with, shape (p, p); where they are
            not known, what the box's steps say.
    """

    def __init__(self, box: SearchBox, bend: Array | None) -> None:
        self._low, self._high = box.bounds.T
        self._is_guess = bend is None
        self.bend = np.diag(_STEEP / box.steps**2) if bend is None else bend

    def step(self, place: Place) -> tuple[Array, float]:
        """Return where to in the box, (p,), and the rise that the slope promises."""
        theta, slope, low, high = place.theta, place.slope, self._low, self._high
        is_held = ((theta <= low) & (slope < 0.0)) | ((theta >= high) & (slope > 0.0))
        bend = self.bend
        if is_held.any():
            slope = np.where(is_held, 0.0, slope)
            bend = np.where(is_held | is_held[:, None], np.diag(bend.diagonal()), bend)
        way = lapack("posv")(bend, slope, lower=1)[1]
        way *= _REACH / max(float(np.abs(way).max()), _REACH)
        end = np.minimum(np.maximum(theta + way, low), high)
        if slope @ (end - theta) <= 0.0:  # the box has cut off what went upwards
            end = np.clip(theta + slope / bend.diagonal(), low, high)
        return end, float(slope @ (end - theta))

    def learn(self, step: Array, fall: Array) -> None:
        """Take in by how much the slope fell along a step."""
        if self._is_guess:
            times = float(step @ fall) / float(step @ self.bend @ step)
            self.bend = self.bend * (np.clip(times, *_RESCALED) if times > 0 else 1.0)
            self._is_guess = False
        known = self.bend @ step
        size, found = float(step @ known), float(step @ fall)
        if found < _DAMPED * size:
            share = (1.0 - _DAMPED) * size / (size - found)
            fall = share * fall + (1.0 - share) * known
            found = _DAMPED * size
        self.bend = self.bend + fall * (fall / found)[:, None]
        self.bend -= known * (known / size)[:, None]


def maximised(
    objective: Objective, place: Place, box: SearchBox, until: Until
) -> tuple[Place, int]:
    """Return the top that a place leads to, and the number of evaluations.

    Args:
        objective: theta -> value and slope.
        place: to begin with.
        box: where it is sought.
        until: what ends it.
    """
    parabola, spent = _Parabola(box, place.bend), 0
    for _ in range(_MOST):
        if until.is_enough(place):
            break
        end, rise = parabola.step(place)
        if rise < 2.0 * until.gain:
            break
        better, tries = _stepped(objective, place, end, rise)
        spent += tries
        if better is None:
            break
        parabola.learn(better.theta - place.theta, place.slope - better.slope)
        place = better
    return place._replace(bend=parabola.bend), spent


def newton_step(place: Place, box: SearchBox) -> tuple[Array, float]:
    """Return the top in a box of the parabola at a place, and the gain it promises."""
    end, rise = _Parabola(box, place.bend).step(place)
    return end, 0.5 * rise


def _stepped(
    objective: Objective, place: Place, end: Array, rise: float
) -> tuple[Place | None, int]:
    """Return where a step leads, made shorter until it keeps a little of its promise.

    None where none does; and the number of evaluations.
    """
    share, step = 1.0, end - place.theta
    for tries in range(1, _HALVINGS + 1):
        found = Place.at(objective, end)
        missing = place.lml + share * rise - found.lml
        if missing <= (1.0 - _ARMIJO) * share * rise:
            return found, tries
        top = 0.5 * rise * share**2 / missing
        least, most = _SHORTER
        share = min(max(top, least * share), most * share)
        end = place.theta + share * step
    return None, _HALVINGS
