"""What dry friction of the drives does to load and push of the foot, by statics.

The person holds the foot's direction and its place along the ground; its load is free.
A step of the foot along the normal turns the motors by w, one along x by s [rad/m].
With friction up to f in every motor, virtual work leaves the load of a foot at rest in

    m g - sum f |w|  <=  F_n  <=  m g + sum f |w|

A foot that slides along x gives friction its sense: F_n is shifted by sum f w sign(s)
and the hand pushes by sum f |s| harder. The forces are those at the sole, where the
wrist sensor measures them: friction changes which loads are reached, not what is read.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wam.calibration.friction_fit import FrictionFit
from wam.model.arm_model import ArmModel
from wam.model.constants import GRAVITY, Array

_SIGMAS = 1.96
_STEP = 0.01  # m between poses along the ground
_CORRECTIONS = 4  # of a pose: each squares its error
_HALF, _TENTH = 0.5, 0.1


@dataclass(frozen=True, slots=True)
class FrictionTorques:
    """What friction may put on the motors 1 to 7 [N m], shapes (7,).

    Attributes:
        at_rest: the most that keeps a motor at rest.
        sliding: of a motor that turns.
    """

    at_rest: Array
    sliding: Array


@dataclass(frozen=True, slots=True)
class FrictionReach:
    """What friction does to a foot on the ground at one place [N].

    Attributes:
        rest: half the width of the interval of F_n at rest.
        shift: of F_n while the foot slides along x.
        push: of the hand along x while the foot slides, beyond that of the ground.
    """

    rest: float
    shift: float
    push: float


@dataclass(frozen=True, slots=True)
class RenderedMasses:
    """Virtual masses from which on the load at rest is what was set [kg].

    Attributes:
        down: the foot surely stands on the ground.
        half: F_n is right within 50 %.
        tenth: F_n is right within 10 %.
    """

    down: float
    half: float
    tenth: float


def remaining_friction(fit: FrictionFit, share: float) -> FrictionTorques:
    """Return the upper end (95 %) of what is left where `share` is compensated.

    Args:
        fit: as identified.
        share: of the lower end that float takes off the hand, 0 = none.
    """
    friction, doubt = fit.friction, _SIGMAS * fit.deviation
    most = friction.coulomb + np.abs(friction.asymmetry) + doubt
    taken = share * np.maximum(fit.lower_bound - np.abs(friction.asymmetry), 0.0)
    return FrictionTorques(most * friction.breakaway - taken, most - taken)


def friction_reach(
    model: ArmModel, q: Array, axes: Array, torques: FrictionTorques
) -> FrictionReach:
    """Return what friction does to the foot of an arm at `q` [rad], shape (7,).

    Args:
        model: the arm with its tool.
        q: joint positions.
        axes: rows x, y and normal of the ground in the base frame, shape (3, 3).
        torques: of friction.
    """
    steps = np.zeros((6, 2))
    steps[:3] = axes[[2, 0]].T
    w, s = (model.constants.j2mp @ np.linalg.pinv(model.sole_jacobian(q)) @ steps).T
    return FrictionReach(
        rest=float(torques.at_rest @ np.abs(w)),
        shift=float(torques.sliding @ (w * np.sign(s))),
        push=float(torques.sliding @ np.abs(s)),
    )


def poses_along(model: ArmModel, q: Array, x: Array, travel: float) -> list[Array]:
    """Return the poses of a foot that goes along the ground without turning.

    Args:
        model: the arm with its tool.
        q: joint positions where it begins [rad], shape (7,).
        x: direction along the ground in the base frame, shape (3,).
        travel: how far [m].
    """
    position, turn = model.sole_pose(q)
    count = max(round(travel / _STEP), 1)
    poses = [q]
    for way in np.linspace(0.0, travel, count + 1)[1:]:
        here = poses[-1]
        for _ in range(_CORRECTIONS):
            at, turned = model.sole_pose(here)
            error = np.concatenate(
                (position + way * x - at, _turn_between(turned, turn))
            )
            here = here + np.linalg.pinv(model.sole_jacobian(here)) @ error
        poses.append(here)
    return poses


def reaches_along(
    model: ArmModel,
    start_q: Array,
    axes: Array,
    travel: float,
    torques: FrictionTorques,
) -> list[FrictionReach]:
    """Return what friction does at every place of a trial, 1 cm apart.

    Args:
        model: the arm with its tool.
        start_q: joint positions where a trial begins [rad], shape (7,).
        axes: rows x, y and normal of the ground in the base frame, shape (3, 3).
        travel: how far a trial goes along x [m].
        torques: of friction.
    """
    poses = poses_along(model, start_q, axes[0], travel)
    return [friction_reach(model, q, axes, torques) for q in poses]


def rendered_masses(
    reaches: Sequence[FrictionReach], incline: float = 0.0
) -> RenderedMasses:
    """Return the virtual masses that serve at the worst of `reaches`.

    Args:
        reaches: at the places of a trial.
        incline: of the ground [rad]; its normal carries the cosine of a weight.
    """
    least = max(reach.rest for reach in reaches) / (GRAVITY * np.cos(incline))
    return RenderedMasses(least, least / _HALF, least / _TENTH)


def _turn_between(turned: Array, wanted: Array) -> Array:
    """Return the small rotation vector that takes `turned` to `wanted` [rad], (3,)."""
    columns = zip(turned.T, wanted.T, strict=True)
    return 0.5 * np.sum([np.cross(have, want) for have, want in columns], axis=0)
