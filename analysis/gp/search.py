"""The search for hyperparameters: bounded quasi-Newton from three starts or four.

One start misses the best optimum of a Gaussian process in every fourth fit or so, and
no three fixed ones suit all data. The first two are therefore chosen among the points
that a kernel offers, by the likelihood of a part of the rows. The third is chosen when
these have reached their tops: as the noise is known by then, the likelihood of all rows
tells where another top may be. A fourth begins at the best top with an input switched
off, where its length is long. A start that comes to stand just below a top that was
reached before is left there, and of the tops that approximations have only those that
may be the best are climbed to the end.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from acquisition.errors import SettingsError
from analysis.data.series import Array
from analysis.gp.approach import GOOD, objective_of
from analysis.gp.ascent import Start, Top, climb, refined
from analysis.gp.kernels import Kernel
from analysis.gp.likelihood import Likelihood
from analysis.gp.low_rank import near_over
from analysis.gp.noise import Noise
from analysis.gp.quasi_newton import Objective, SearchBox
from analysis.gp.trial_noise import TrialRows

Score = Callable[[Array], float]

_AT_BOUND = 1e-3
_NOISE_STEP = 0.1  # the likelihood bends most along the noise: its steps are shorter
_APART = 1.5  # of starts in one of the shape: two steps of the lengths offered
_ELSEWHERE = 1.0  # a start nearer to a known top leads back to it
_LONG = 1.0  # logarithm of a length from which on an input may be idle
_ROUGH = 150  # rows by which the first starts are chosen
_RIVAL = 5.0  # log likelihood below the best one at which a top may still become it
_NEIGHBOURS = 0.5  # tops nearer to each other in the shape are one
_FLAT = 3.0  # logarithm from which on a length or bias makes no difference


class StartScores(NamedTuple):
    """What tells a search where to start; either may raise SettingsError.

    Attributes:
        rough: theta -> likelihood of a part of the rows.
        exact: theta -> likelihood of all rows.
    """

    rough: Score
    exact: Score


class Optimum(NamedTuple):
    """The best hyperparameters found and every start's result.

    Attributes:
        theta: hyperparameters of largest likelihood.
        lml: log marginal likelihood there, priors included.
        starts: where every start ended.
        began: where it began.
        at_bound: hyperparameters at the edge of the search.
    """

    theta: Array
    lml: float
    starts: tuple[Start, ...]
    began: tuple[Array, ...]
    at_bound: tuple[str, ...]


def maximise(
    model: tuple[Kernel, Noise],
    objective: Objective,
    X: Array,
    sd_y: float,
    scores: StartScores,
) -> Optimum:
    """Return the hyperparameters of largest likelihood.

    Args:
        model: kernel and noise; theta is the kernel's, then the noise's.
        objective: theta -> likelihood and its slope; may raise SettingsError.
        X: inputs, shape (n, d); they set the scale of starts and bounds.
        sd_y: standard deviation of the outputs.
        scores: what starts are chosen by.
    """
    kernel, noise = model
    box = _box(model, X, sd_y)
    rough, exact = scores
    offered = [
        np.concatenate([point, noise.start(sd_y)])
        for point in kernel.design(sd_y, spread(X))
    ]
    began = _first_starts(kernel, offered, rough)
    reached: list[Top] = []
    for start in began:
        reached.append(climb(objective, start, box, reached))
    began.append(_last_start(kernel, offered, exact, (began, reached), box))
    reached.append(climb(objective, began[-1], box, reached))
    best = max(reached, key=lambda start: start.lml)
    for start in _idle_starts(model, best, exact, box):
        began.append(start)
        reached.append(climb(objective, start, box, reached))
    return _optimum(model, box, (began, refined(objective, box, reached)))


def climb_from(
    model: tuple[Kernel, Noise],
    objective: Objective,
    X: Array,
    sd_y: float,
    starts: Sequence[Array],
    exact: Score | None = None,
) -> Optimum:
    """Return the best top that starts lead to: for where tops are nearly known.

    Args:
        model: kernel and noise; theta is the kernel's, then the noise's.
        objective: theta -> likelihood and its slope; may raise SettingsError.
        X: inputs, shape (n, d).
        sd_y: standard deviation of the outputs.
        starts: thetas to begin with.
        exact: theta -> likelihood of all rows: one more start is chosen by it, where
            the best top may be another one than those known.
    """
    box, reached = _box(model, X, sd_y), list[Top]()
    began = list(starts)
    for start in began:
        reached.append(climb(objective, start, box, reached))
    if exact is not None:
        last = _last_start(model[0], began, exact, (began, reached), box)
        began.append(last)
        reached.append(climb(objective, last, box, reached))
        best = max(reached, key=lambda start: start.lml)
        for start in _idle_starts(model, best, exact, box):
            began.append(start)
            reached.append(climb(objective, start, box, reached))
    return _optimum(model, box, (began, refined(objective, box, reached)))


def distinct_tops(kernel: Kernel, reached: Sequence[Start]) -> list[Array]:
    """Return the tops that starts reached, best first; no two of them are neighbours.

    Tops too far below the best one are left out.
    """
    tops: list[Array] = []
    ranked = sorted(reached, key=lambda start: -start.lml)
    for start in ranked:
        theta = np.array(start.theta)
        if ranked[0].lml - start.lml > _RIVAL:
            break
        if not tops or _gap(kernel, theta, tops) >= _NEIGHBOURS:
            tops.append(theta)
    return tops


def _box(model: tuple[Kernel, Noise], X: Array, sd_y: float) -> SearchBox:
    """Return where theta is sought."""
    kernel, noise = model
    bounds = np.vstack([kernel.bounds(sd_y, spread(X)), noise.bounds(sd_y)])
    steps = np.repeat([1.0, _NOISE_STEP], [len(kernel.names), len(noise.names)])
    return SearchBox(bounds, steps)


def _optimum(
    model: tuple[Kernel, Noise],
    box: SearchBox,
    climbed: tuple[Sequence[Array], list[Top]],
) -> Optimum:
    """Return the best of what the starts reached."""
    kernel, noise = model
    began, reached = climbed
    best = max(reached, key=lambda start: start.lml)
    is_edge = np.abs(box.bounds - best.theta[:, None]).min(axis=1) < _AT_BOUND
    edges = np.array([*kernel.names, *noise.names])[is_edge]
    starts = tuple(top.start for top in reached)
    return Optimum(best.theta, best.lml, starts, tuple(began), tuple(map(str, edges)))


def spread(X: Array) -> Array:
    """Return the standard deviation of every column, 1 where it does not vary."""
    sd = X.std(axis=0)
    return np.where(np.ptp(X, axis=0) > 0, sd, 1.0)


def _first_starts(
    kernel: Kernel, offered: Sequence[Array], rough: Score
) -> list[Array]:
    """Return two of the points offered: the best, and the best that is far from it."""
    ranked = sorted(offered, key=lambda theta: -_scored(rough, theta))
    first, *others = ranked
    far = (theta for theta in others if _gap(kernel, theta, [first]) >= _APART)
    return [first, next(far, others[0])]


def _last_start(
    kernel: Kernel,
    offered: Sequence[Array],
    exact: Score,
    known: tuple[Sequence[Array], Sequence[Top]],
    box: SearchBox,
) -> Array:
    """Return the likeliest point that may belong to another top.

    That is a move from the best top that the kernel knows, or where it knows none, one
    of the points offered; with the noise of that top.

    Args:
        kernel: its moves.
        offered: points that a search may start with.
        exact: theta -> likelihood of all rows.
        known: where other starts began, and what they reached.
        box: where theta is sought.
    """
    began, reached = known
    count = len(kernel.names)
    tops = [top.theta for top in reached]
    top = max(reached, key=lambda top: top.lml)
    best, score = top.theta, _score_near(top, exact)
    others = kernel.moves(best[:count]) or [
        theta[:count] for theta in offered if _gap(kernel, theta, began) >= _APART
    ]
    points = [
        np.clip(np.concatenate([point, best[count:]]), *box.bounds.T)
        for point in others
    ]
    far = [point for point in points if _gap(kernel, point, tops) >= _ELSEWHERE]
    return max(far or offered, key=lambda theta: _scored(score, theta))


def _idle_starts(
    model: tuple[Kernel, Noise], best: Top, exact: Score, box: SearchBox
) -> list[Array]:
    """Return the best top without a long length, where that costs next to nothing.

    On a straight trend a long length and an endless one are two tops. Of several inputs
    the likeliest one to be idle is chosen.
    """
    (kernel, _), score = model, _score_near(best, exact)
    starts = []
    for k, name in enumerate(kernel.names):
        theta = best.theta.copy()
        is_length = name.rpartition("_")[2].startswith("l")
        if is_length and _LONG < theta[k] < box.bounds[k, 1] - _NEIGHBOURS:
            theta[k] = box.bounds[k, 1]
            starts.append((_scored(score, theta), k, theta))
    if not starts or max(starts)[0] < best.lml - _RIVAL:
        return []
    return [max(starts)[2]]


def _gap(kernel: Kernel, theta: Array, others: Sequence[Array]) -> float:
    """Return how far theta is from the nearest of others in one of the shape."""
    shape = [k for k, name in enumerate(kernel.names) if not name.endswith("log_sf")]
    flat = np.minimum(np.vstack([theta, *others])[:, shape], _FLAT)
    return float(np.abs(flat[1:] - flat[0]).max(axis=1).min())


def _score_near(top: Top, exact: Score) -> Score:
    """Return the likelihood of all rows, by the approximation of a top where good.

    Args:
        top: how it was approached.
        exact: theta -> likelihood of all rows.
    """

    def score(theta: Array) -> float:
        if top.approach is not None:
            value, error = top.approach.near.value(theta)
            if error < GOOD[1]:
                return value
        return exact(theta)

    return score


def _scored(score: Score, theta: Array) -> float:
    try:
        return score(theta)
    except SettingsError:
        return -np.inf


def posterior_search(
    model: tuple[Kernel, Noise], X: Array, r: Array, trials: TrialRows | None = None
) -> Optimum:
    """Return the hyperparameters of largest likelihood times the noise's prior."""
    return likeliest(Likelihood(model, X, r, trials))


def likeliest(likelihood: Likelihood) -> Optimum:
    """Return the hyperparameters of largest likelihood times the noise's prior."""
    model, X, r = likelihood.model, likelihood.X, likelihood.r
    objective = objective_of(likelihood, near_over(likelihood))
    rough = likelihood.thinned(_ROUGH)
    scores = StartScores(rough.value, objective.value)
    return maximise(model, objective, X, float(np.std(r)), scores)
