"""One climb: from a start to a top of the likelihood, or just below a known one.

L-BFGS-B in a box. Where an approximation is good (`low_rank`), it is climbed in the
place of the likelihood, which only corrects it at the end: around theta_k

    f(theta) ~ g(theta) + (f'(theta_k) - g'(theta_k))' (theta - theta_k)

has the exact slope, and its top is theta_k+1 (Alexandrov and Lewis 2001). The climb has
ended where that promises to gain nothing. Where it does not keep what it promises, the
likelihood itself is climbed.
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
    HOPELESS,
    Objective,
    SearchBox,
    Start,
    maximised,
    tried,
)

_SAME_TOP = (0.2, 0.1)  # largest difference of thetas, and of likelihoods
_REACH = 2.0  # of theta that an approximation is climbed over before it is made anew
_NEARLY = 1.0  # a shorter way needs no other approximation
_CORRECTIONS = 6  # steps by corrected slopes; two or three do
_GAIN = 1e-5  # log likelihood below which a step is not worth an exact evaluation
# twice the error that approximations aim at, and that they may have at most: on the
# way, one after the other, and at the top
_FAIR, GOOD = ((0.1, 5.0), (0.1, 5.0), (0.1, 5.0)), (0.1, 0.3)
_DIFFERENCE = 1e-4  # of theta, for second derivatives
_FLAT = 1e-2  # smallest second derivative that counts
_FURTHEST = 0.3  # that a parabola is believed
_ROUGH, _FINE, _PRECISE = 1e-6, 1e-8, 5e-10  # relative changes that end a climb
_LOST = (1.0, 3, 0.05)  # below the best top, steps, and their share of what is missing
_KEPT = 0.3  # share of the promised gain below which an approximation is given up


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


def climb(
    objective: Objective, start: Array, box: SearchBox, known: Sequence[Start]
) -> Start:
    """Return where a start ends: on a top, or just below one of those known.

    Args:
        objective: theta -> likelihood and its slope.
        start: theta to begin with.
        box: where theta is sought.
        known: what other starts have reached.
    """
    is_lost = _watch(known)

    def is_enough(theta: Array, lml: float) -> bool:
        return _is_below(theta, lml, known) or is_lost(lml)

    theta = np.clip(start, *box.bounds.T)
    if not isinstance(objective, Approximated):
        return maximised(objective, theta, box, (_PRECISE, is_enough))
    if known:
        best = max(known, key=lambda start: start.lml)
        if objective.near(np.array(best.theta), GOOD) is None:  # tops are rough here
            return maximised(objective, theta, box, (_ROUGH, is_enough))
    theta = _approached(objective, theta, box, known)
    end, is_top = _corrected(objective, theta, box, known)
    if is_top:
        return end
    rest = maximised(objective, np.array(end.theta), box, (_ROUGH, is_enough))
    # on a ridge that may stop short of the top
    last, _ = _corrected(objective, np.array(rest.theta), box, known)
    best = max(rest, last, key=lambda start: start.lml)
    spent = end.evaluations + rest.evaluations + last.evaluations
    return best._replace(evaluations=spent)


def _watch(known: Sequence[Start]) -> Callable[[float], bool]:
    """Return what tells, step by step, that a climb will not reach the best known top.

    It is lost far below, where the last steps gained little of what is missing.
    """
    best = max((start.lml for start in known), default=-np.inf)
    below, steps, share = _LOST
    passed: list[float] = []

    def is_lost(lml: float) -> bool:
        passed.append(lml)
        missing = best - lml
        if len(passed) <= steps or missing < below:
            return False
        return lml - passed[-1 - steps] < share * missing

    return is_lost


def _approached(
    objective: Approximated, theta: Array, box: SearchBox, known: Sequence[Start]
) -> Array:
    """Return where climbing approximations leads; theta itself where there is none."""

    def is_enough(theta: Array, lml: float) -> bool:
        return bool(_tops_at(theta, lml, known))

    for error in _FAIR:
        near = objective.near(theta, error)
        if near is None:
            break
        before, region = theta, box.around(theta, _REACH)
        end = maximised(near, theta, region, (_ROUGH, is_enough))
        theta = np.array(end.theta)
        if np.abs(theta - before).max() < _NEARLY:
            break
    return theta


def _corrected(
    objective: Approximated, theta: Array, box: SearchBox, known: Sequence[Start]
) -> tuple[Start, bool]:
    """Return where the approximation leads to when it has the exact slope.

    Its parabola for short steps; for longer ones, and where that fails, itself.

    Returns:
        Where that ends, and whether it is a top or just below a known one; if not, the
        approximation is too poor.
    """
    near = objective.near(theta, GOOD)
    if near is None:
        return Start(tuple(theta.tolist()), -HOPELESS, 0), False
    lml, slope = tried(objective, theta)
    if _is_below(theta, lml, known):
        return Start(tuple(theta.tolist()), lml, 1), True
    bend, is_bent, spent = _curvature(near, theta, box), False, 1
    while spent < _CORRECTIONS:
        at = theta, slope
        top, gain = _vertex(bend, at, box)
        if is_bent or np.abs(top - theta).max() > _FURTHEST:
            (top, gain), is_bent = _stepped(near, at, box), True
        if 0.0 <= gain < _GAIN:
            return Start(tuple(theta.tolist()), lml, spent), True
        better, new_slope = tried(objective, top)
        spent += 1
        is_kept = better >= lml + _KEPT * gain and gain > 0.0
        if better > lml:
            theta, lml, slope = top, better, new_slope
        if not is_kept and is_bent:
            break
        is_bent = not is_kept
    return Start(tuple(theta.tolist()), lml, spent), False


def _curvature(near: Objective, theta: Array, box: SearchBox) -> Array:
    """Return minus the second derivatives of an approximation, shape (p, p)."""
    inwards = np.where(theta < box.bounds.mean(axis=1), _DIFFERENCE, -_DIFFERENCE)
    slope = tried(near, theta)[1]
    rows = [
        (slope - tried(near, theta + step)[1]) / step.sum() for step in np.diag(inwards)
    ]
    return 0.5 * (np.array(rows) + np.array(rows).T)


def _vertex(
    bend: Array, at: tuple[Array, Array], box: SearchBox
) -> tuple[Array, float]:
    """Return the top of a parabola in the box, and what it promises.

    Directions along which it is flat, or bends upwards, count as bent a little.

    Args:
        bend: minus its second derivatives, shape (p, p).
        at: theta, and the slope there.
        box: where the top is sought.
    """
    (theta, slope), (low, high) = at, box.bounds.T
    is_held = ((theta <= low) & (slope < 0.0)) | ((theta >= high) & (slope > 0.0))
    free = np.flatnonzero(~is_held)
    bends, ways = np.linalg.eigh(bend[np.ix_(free, free)])
    step = np.zeros(theta.size)
    step[free] = ways @ ((ways.T @ slope[free]) / np.maximum(bends, _FLAT))
    top = np.clip(theta + step, low, high)
    step = top - theta
    return top, float(slope @ step - 0.5 * step @ bend @ step)


def _stepped(
    near: Objective, at: tuple[Array, Array], box: SearchBox
) -> tuple[Array, float]:
    """Return the top of an approximation with another slope, and what it promises.

    Args:
        near: the approximation.
        at: theta, and the exact slope there.
        box: where the top is sought.
    """
    theta, slope = at
    value, own = tried(near, theta)
    missing = slope - own

    def corrected(there: Array) -> tuple[float, Array]:
        lml, slope = near(there)
        return lml - value + float(missing @ (there - theta)), slope + missing

    top = maximised(corrected, theta, box.around(theta, _REACH), (_FINE, None))
    return np.array(top.theta), top.lml


def _is_below(theta: Array, lml: float, known: Sequence[Start]) -> bool:
    """Return whether theta is just below a known top."""
    return any(lml <= top.lml for top in _tops_at(theta, lml, known))


def _tops_at(theta: Array, lml: float, known: Sequence[Start]) -> list[Start]:
    """Return the known tops that are near, in theta and in likelihood."""
    near, low = _SAME_TOP
    return [
        top
        for top in known
        if abs(top.lml - lml) < low and np.abs(theta - top.theta).max() < near
    ]


def objective_of(
    model: tuple[Kernel, Noise], likelihood: Objective, near: Near
) -> Approximated:
    """Return what is climbed: the likelihood times the noise's prior.

    Args:
        model: kernel and noise.
        likelihood: the exact one.
        near: its approximations.
    """

    def near_with_prior(theta: Array, trace: tuple[float, float]) -> Objective | None:
        found = near(theta, trace)
        return None if found is None else _with_prior(model, found)

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
