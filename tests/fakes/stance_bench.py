"""Stances on the simulated ground alone: two masses on it, no arm.

The ground, the law of the sole, the sequence and the policies are those of a session;
the masses stand in for the arm as in `point_foot`. Forces are those of the ground,
without a sensor's errors.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import exp, log, nan, radians

import numpy as np

from acquisition.control_loop.law import SoleGoal
from analysis.breakaway.fitting import fit_pushes
from analysis.breakaway.model import BreakAwayModel
from analysis.breakaway.pushes import FootPush
from analysis.breakaway.recorded import BreakAwayOptions
from analysis.data.series import TractionSeries
from analysis.foresight.engine import Foresight, ForesightFlag
from analysis.foresight.model import ForesightModel, Provenance, RigIdentity
from analysis.foresight.signals import FootSample
from analysis.foresight.training import fit_ground
from analysis.foresight.watching import WatchedTrial, watch_series
from analysis.stance.interface import (
    StanceCommand,
    StanceForesight,
    StancePhase,
    StanceRequest,
    StanceSample,
)
from analysis.stance.outcomes import StanceOutcome
from analysis.stance.policies import avoid_slip
from analysis.stance.sequence import SoleView, StancePlan, StanceSequence
from fakes.ground.terrain import GroundChoice
from fakes.world.stance_bed import PERIOD, TICK_CYCLES, StanceBed
from tests.fakes.point_foot import GROUNDS

TRAVEL = 0.45  # m
RIG = RigIdentity("true", "true", "0.3", "0.45")
_STONES = "small", "big"
KINDS = {name: stones for name, (stones, _, _) in GROUNDS.items()}
TRAINING = 10_000  # trials of this number and more teach
_PROBES, _BEDS, _STANCES = 6, 8, 25  # that teach, of every terrain
_LONGEST = 2000  # ticks of a stance and the way to it


class StanceBench(StanceBed):
    """One bed of a terrain of the study."""

    def __init__(self, terrain: str, seed: int, trial: int) -> None:
        stones, foot, incline_deg = GROUNDS[terrain]
        choice = GroundChoice(stones, foot)
        super().__init__(terrain, choice, radians(incline_deg), TRAVEL, (seed, trial))

    def view(self, shares: Mapping[str, float]) -> SoleView:
        capacity = self.capacity if self.F_n > 0.0 else nan
        return SoleView(self.x, self.z, self.F_t, self.F_n, shares, capacity)


def record(
    bench: StanceBench, plan: StancePlan, model: ForesightModel | None = None
) -> StanceSequence:
    """Return a recording of stances, made now."""
    sequence, shares = StanceSequence(plan), {}
    foresight = None if model is None else Foresight(model, {}, RIG)
    for _ in range(_LONGEST * plan.count):
        goal = sequence.next_goal(bench.view(shares))
        if sequence.is_over:
            return sequence
        if sequence.state == "carry":
            bench.carry(goal.x)
            continue
        bench.aim(goal)
        shares = {}
        for _ in range(TICK_CYCLES):
            bench.cycle()
            if model is not None and foresight is not None and not sequence.outcomes:
                shares = _felt(foresight, model, bench) or shares
    raise AssertionError(f"a stance does not end: {sequence.state}")


def _felt(
    foresight: Foresight, model: ForesightModel, bench: StanceBench
) -> dict[str, float]:
    sample = FootSample(bench.cycles, bench.now_ns, bench.x, bench.F_t, bench.F_n)
    state = foresight.push(sample)
    if state is None or not state.flags & ForesightFlag.GROUND:
        return {}
    return dict(zip(model.terrains, state.terrains, strict=True))


class _Draws:
    """A policy that pushes at random: what break-away is learnt from."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._load = self._most = 0.0

    def __call__(
        self, sample: StanceSample, foresight: StanceForesight, request: StanceRequest
    ) -> StanceCommand:
        if sample.last.phase is StancePhase.LOAD and not sample.is_loaded:
            if sample.last.most != self._most:
                self._load = exp(self._rng.uniform(log(3.0), log(20.0)))
                self._most = float(
                    self._rng.uniform(1.0, min(11.0, 1.2 * self._load + 4.0))
                )
            return StanceCommand(0.0, self._load, StancePhase.LOAD, most=self._most)
        return avoid_slip(sample, foresight, request)


def taught(terrain: str, seed: int) -> list[list[FootPush]]:
    """Return pushes of stances with random forces, by bed."""
    beds = []
    for k in range(_BEDS):
        rng = np.random.default_rng((seed, k, 77))
        plan = StancePlan(
            _Draws(rng), StanceRequest(), _STANCES, TRAVEL, float(rng.random())
        )
        made = record(StanceBench(terrain, seed, TRAINING + k), plan)
        beds.append([p for one in made.outcomes if (p := one.push) is not None])
    return beds


def learn_break_away(
    pushes: Mapping[str, list[list[FootPush]]],
) -> dict[str, BreakAwayModel]:
    """Return the break-away models of pushes by terrain."""
    kinds = {name: KINDS[name] for name in pushes}
    return fit_pushes(pushes, kinds, BreakAwayOptions(draws=1))


def felt_series(terrain: str, seed: int, trial: int) -> TractionSeries:
    """Return a foot that is drawn along, as before the first stance."""
    bench = StanceBench(terrain, seed, trial)
    bench.z = 0.005
    bench.axes.begin(0.0, bench.z, 0)
    rows = []
    for tick in range(350):
        end = 0.0 if tick < 50 else 0.30
        bench.aim(SoleGoal(nan, 4.0, end, 0.0, 0.05))
        for _ in range(TICK_CYCLES):
            bench.cycle()
            rows.append((bench.vx, bench.F_n, bench.F_t))
    v, F_n, F_t = np.array(rows[400:]).T
    t = PERIOD * np.arange(v.size)
    return TractionSeries(terrain, f"{terrain}-{trial}", t, v, F_n, F_t)


def felt(terrain: str, seed: int) -> list[WatchedTrial]:
    """Return a foot that is drawn over beds of a terrain, as foresight watches it."""
    surface = "flat" if KINDS[terrain] == "none" else "rocky"
    series = [felt_series(terrain, seed, TRAINING + 100 + k) for k in range(_PROBES)]
    return [watch_series(one, surface, RIG) for one in series]


def learn_foresight(watched: Sequence[WatchedTrial]) -> ForesightModel:
    """Return what feeling grounds teaches of them; slips are not foreseen."""
    names = tuple(one.name for one in watched)
    return ForesightModel(None, fit_ground(watched), Provenance((RIG,), names, ()))


def stances(
    terrain: str,
    plan: StancePlan,
    seed: int,
    beds: int,
    model: ForesightModel | None,
    make: Callable[[str, int, int], StanceBench] = StanceBench,
) -> list[StanceOutcome]:
    """Return recordings of stances on beds of their own, adapted on and on."""
    made: list[StanceOutcome] = []
    for k in range(beds):
        rng = np.random.default_rng((seed, k, 5))
        bench = make(terrain, seed, k)
        one = record(bench, replace(plan, phase=float(rng.random())), model)
        made += one.outcomes
        plan = replace(plan, scale=one.scale)
    return made
