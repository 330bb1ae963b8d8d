"""One recording of stances: feel the ground, then lift, set down, load, stand, again.

A pure machine of states: what the foot does comes in every 20 ms, what the sole is to
do goes out. The policy is asked for what a stance does and nothing else. Spots follow
the golden ratio, so that each is fresh and at least 2 d50 from the one before.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum, auto
from math import nan
from typing import Final

from acquisition.control_loop.law import SoleGoal
from analysis.foresight.engine import RiskTable
from analysis.stance.interface import (
    BEGIN,
    StanceForesight,
    StancePolicy,
    StanceRequest,
)
from analysis.stance.outcomes import StanceOutcome, adapted
from analysis.stance.standing import TICK, Loading, StandingFoot

HEIGHT = 0.022  # m, the foot is lifted 20 mm
_ALOFT = 0.012  # m, above which it is carried on
_BELOW = 0.02  # m, where a foot that is lowered aims at
_LOWERING, _CARRYING = 0.05, 0.15  # m/s
TOUCH: Final = 1.0  # N, from which a foot stands on the ground
_CLOSE, _SLOW = 0.004, 0.02  # m, m/s: a foot has arrived
# An arm that rubs stops short of its spot; there it stands as well.
_NEAR, _RESTED = 0.04, 15  # m, ticks at rest
_MARGIN = 0.03  # m of the container that is not stood on, at both ends
_GOLDEN = 0.618034
# Neighbours in the row lie 0.38 of the free way apart: 2 d50 of the big stones here.
LEAST_TRAVEL: Final = 0.26  # m
PROBE_WAY, PROBE_SPEED, PROBE_LOAD = 0.08, 0.05, 4.0  # m, m/s, N
_LONGEST_STEP = 6.0  # s that carrying, lowering or feeling may take


class StanceStep(Enum):
    """What the foot is doing."""

    CARRY = auto()
    LOWER = auto()
    FEEL_LOAD = auto()
    FEEL = auto()
    STAND = auto()
    LIFT = auto()
    OVER = auto()


@dataclass(frozen=True, slots=True)
class SoleView:
    """What the foot does, every 20 ms, terrain frame.

    Attributes:
        x, z: place of the sole [m].
        F_t, F_n: traction and normal force [N].
        shares: probability of every terrain; empty = not known (yet).
        capacity: traction that the ground truly bears [N]; NaN = nobody knows.
    """

    x: float
    z: float
    F_t: float
    F_n: float
    shares: Mapping[str, float] = field(default_factory=dict[str, float])
    capacity: float = nan


@dataclass(frozen=True, slots=True)
class StancePlan:
    """What a recording of stances is.

    Attributes:
        policy: chooses force and load.
        request: what is asked of every stance.
        count: number of stances.
        travel: length of the container [m].
        phase: 0..1, where the row of spots begins.
        tables: risk by terrain; empty = nothing is foreseen.
        scale: by which the ground is taken to bear more at first.
    """

    policy: StancePolicy
    request: StanceRequest
    count: int
    travel: float
    phase: float
    tables: Mapping[str, RiskTable] = field(default_factory=dict[str, RiskTable])
    scale: float = 1.0

    def spot(self, number: int) -> float:
        """Return where stance `number`, from 0, stands [m]."""
        return place_at((self.phase + _GOLDEN * number) % 1.0, self.travel)


def place_at(share: float, travel: float) -> float:
    """Return a place [m] at a share, 0 to 1, of a container of `travel` [m]."""
    return _MARGIN + (travel - 2.0 * _MARGIN) * share


def lowering(x: float) -> SoleGoal:
    """Return the goal of a foot that is set down at `x` [m]."""
    return SoleGoal(nan, nan, x, -_BELOW, _LOWERING)


class StanceSequence:
    """Sets the foot down again and again, and asks the policy.

    Attributes:
        outcomes: of the stances that are over.
        scale: by which the ground is taken to bear more now.
        shares: terrains as they were felt before the first stance.
    """

    def __init__(self, plan: StancePlan) -> None:
        self.outcomes: list[StanceOutcome] = []
        self.scale = plan.scale
        self.shares: Mapping[str, float] = {}
        self._plan = plan
        self._is_felt = not plan.tables
        self._step = StanceStep.CARRY
        self._since = 0.0
        self._before: float | None = None
        self._calm = 0
        self._loading = Loading()
        self._foot = StandingFoot(0.0, plan.scale)

    @property
    def is_over(self) -> bool:
        """Whether every stance was made and the foot is lifted."""
        return self._step is StanceStep.OVER

    @property
    def is_stuck(self) -> bool:
        """Whether the foot does not get on with what it is to do."""
        return self._since > _LONGEST_STEP

    @property
    def state(self) -> str:
        """What the foot is doing, in a word."""
        if self._step is StanceStep.STAND:
            return self._foot.command.phase.value
        return self._step.name.lower().replace("_", " ")

    def next_goal(self, view: SoleView) -> SoleGoal:
        """Return what the sole is to do in the next 20 ms."""
        v_t = 0.0 if self._before is None else (view.x - self._before) / TICK
        self._before = view.x
        self._since += TICK
        if view.shares and self._step in (StanceStep.FEEL, StanceStep.FEEL_LOAD):
            self.shares = dict(view.shares)
        match self._step:
            case StanceStep.CARRY:
                return self._carry(view, v_t)
            case StanceStep.LOWER:
                return self._lower(view)
            case StanceStep.FEEL_LOAD | StanceStep.FEEL:
                return self._feel(view)
            case StanceStep.STAND:
                return self._stand(view, v_t)
            case _:
                return self._lift(view)

    def _enter(self, step: StanceStep) -> None:
        self._step, self._since, self._calm = step, 0.0, 0
        self._loading = Loading()

    @property
    def _goal_x(self) -> float:
        if not self._is_felt:
            return _MARGIN
        return self._plan.spot(len(self.outcomes))

    def _carry(self, view: SoleView, v_t: float) -> SoleGoal:
        """Lift where it is, then carry."""
        is_aloft = view.z > _ALOFT
        x = self._goal_x
        is_calm = is_aloft and abs(view.x - x) < _NEAR and abs(v_t) < _SLOW
        self._calm = self._calm + 1 if is_calm else 0
        if self._calm >= _RESTED or (is_calm and abs(view.x - x) < _CLOSE):
            self._enter(StanceStep.LOWER)
        return SoleGoal(nan, nan, x if is_aloft else view.x, HEIGHT, _CARRYING)

    def _lower(self, view: SoleView) -> SoleGoal:
        if view.F_n <= TOUCH:
            return lowering(self._goal_x)
        if not self._is_felt:
            self._enter(StanceStep.FEEL_LOAD)
            return SoleGoal(nan, PROBE_LOAD, view.x, 0.0, _LOWERING)
        self._enter(StanceStep.STAND)
        self._foot = StandingFoot(self._goal_x, self.scale)
        return SoleGoal(0.0, BEGIN.F_n, view.x, 0.0, 0.0)

    def _feel(self, view: SoleView) -> SoleGoal:
        """Load the foot, then draw it on, so that the ground is recognised."""
        if self._step is StanceStep.FEEL_LOAD:
            self._loading.seconds += TICK
            if self._loading.is_over(view.F_n, PROBE_LOAD):
                self._enter(StanceStep.FEEL)
            return SoleGoal(nan, PROBE_LOAD, view.x, 0.0, 0.0)
        end = _MARGIN + PROBE_WAY
        if view.x >= end - _CLOSE or self._since > 2.0 * PROBE_WAY / PROBE_SPEED:
            self._is_felt = True
            self._enter(StanceStep.LIFT)
        return SoleGoal(nan, PROBE_LOAD, end, 0.0, PROBE_SPEED)

    def _stand(self, view: SoleView, v_t: float) -> SoleGoal:
        foot, plan = self._foot, self._plan
        foresight = StanceForesight(self.shares, plan.tables, self.scale, view.capacity)
        sample = foot.sample(view.x, v_t, view.F_t, view.F_n, foresight)
        goal = foot.goal(plan.policy(sample, foresight, plan.request), view.x)
        if foot.is_done and (outcome := foot.outcome(plan.request)) is not None:
            self.outcomes.append(outcome)
            self.scale = adapted(self.scale, outcome)
            self._enter(StanceStep.LIFT)
        return goal

    def _lift(self, view: SoleView) -> SoleGoal:
        if view.z > _ALOFT and self._step is StanceStep.LIFT:
            is_last = len(self.outcomes) >= self._plan.count
            self._enter(StanceStep.OVER if is_last else StanceStep.CARRY)
        return SoleGoal(nan, nan, view.x, HEIGHT, _CARRYING)
