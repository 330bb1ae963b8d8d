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
    StanceCommand,
    StanceForesight,
    StancePhase,
    StancePolicy,
    StanceRequest,
    StanceSample,
)
from analysis.stance.outcomes import (
    StanceOutcome,
    StanceWatch,
    adapted,
    stated_risk,
)

TICK: Final = 0.02  # s
HEIGHT = 0.022  # m, the foot is lifted 20 mm
_ALOFT = 0.012  # m, above which it is carried on
_BELOW = 0.02  # m, where a foot that is lowered aims at
_LOWERING, _CARRYING = 0.05, 0.15  # m/s
_TOUCH = 1.0  # N
_CLOSE, _SLOW = 0.004, 0.02  # m, m/s: a foot has arrived
# An arm that rubs stops short of its spot; there it stands as well.
_NEAR, _RESTED = 0.04, 15  # m, ticks at rest
_WITHIN, _SETTLED, _LONGEST_LOADING = 0.1, 5, 1.5  # of F_n, ticks, s
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
        free = self.travel - 2.0 * _MARGIN
        return _MARGIN + free * ((self.phase + _GOLDEN * number) % 1.0)


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
        self._command: StanceCommand = BEGIN
        self._watch: StanceWatch | None = None
        self._t = 0.0

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
            return self._command.phase.value
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
        if view.F_n <= _TOUCH:
            return SoleGoal(nan, nan, self._goal_x, -_BELOW, _LOWERING)
        if not self._is_felt:
            self._enter(StanceStep.FEEL_LOAD)
            return SoleGoal(nan, PROBE_LOAD, view.x, 0.0, _LOWERING)
        self._enter(StanceStep.STAND)
        self._command, self._watch, self._t = BEGIN, None, 0.0
        return SoleGoal(0.0, BEGIN.F_n, view.x, 0.0, 0.0)

    def _feel(self, view: SoleView) -> SoleGoal:
        """Load the foot, then draw it on, so that the ground is recognised."""
        if self._step is StanceStep.FEEL_LOAD:
            if self._is_loaded(view, PROBE_LOAD):
                self._enter(StanceStep.FEEL)
            return SoleGoal(nan, PROBE_LOAD, view.x, 0.0, 0.0)
        end = _MARGIN + PROBE_WAY
        if view.x >= end - _CLOSE or self._since > 2.0 * PROBE_WAY / PROBE_SPEED:
            self._is_felt = True
            self._enter(StanceStep.LIFT)
        return SoleGoal(nan, PROBE_LOAD, end, 0.0, PROBE_SPEED)

    def _is_loaded(self, view: SoleView, wanted: float) -> bool:
        """Return whether the load has been there for 0.1 s, or will not come."""
        is_there = abs(view.F_n - wanted) < _WITHIN * wanted + 0.2
        self._calm = self._calm + 1 if is_there else 0
        return self._calm >= _SETTLED or self._since > _LONGEST_LOADING

    def _stand(self, view: SoleView, v_t: float) -> SoleGoal:
        foresight = StanceForesight(
            self.shares, self._plan.tables, self.scale, view.capacity
        )
        command = self._command
        is_loading = self._watch is None
        is_begun = (
            is_loading and self._since > TICK and self._is_loaded(view, command.F_n)
        )
        if is_begun:
            risk = stated_risk(foresight, command.most, command.F_n)
            self._watch = StanceWatch(self._goal_x, risk, self.scale, view.x)
        elif self._watch is not None:
            self._t += TICK
            self._watch.push(TICK, view.x, v_t, view.F_t, view.F_n)
        watch = self._watch
        sample = StanceSample(
            t=self._t,
            is_loaded=watch is not None,
            x=0.0 if watch is None else view.x - watch.x0,
            v_t=v_t,
            F_t=view.F_t,
            F_n=view.F_n,
            impulse=0.0 if watch is None else watch.delivered,
            last=command,
        )
        self._command = self._plan.policy(sample, foresight, self._plan.request)
        if watch is not None and self._command.phase is StancePhase.DONE:
            self._end(watch)
        # A foot that slipped is held where it is; with no force it would coast on.
        is_held = self._command.phase is StancePhase.BACK_OFF
        F_t = nan if is_held else self._command.F_t
        return SoleGoal(F_t, self._command.F_n, view.x, 0.0, 0.0)

    def _end(self, watch: StanceWatch) -> None:
        outcome = watch.outcome(self._plan.request)
        self.outcomes.append(outcome)
        self.scale = adapted(self.scale, outcome)
        self._enter(StanceStep.LIFT)

    def _lift(self, view: SoleView) -> SoleGoal:
        if view.z > _ALOFT and self._step is StanceStep.LIFT:
            is_last = len(self.outcomes) >= self._plan.count
            self._enter(StanceStep.OVER if is_last else StanceStep.CARRY)
        return SoleGoal(nan, nan, view.x, HEIGHT, _CARRYING)
