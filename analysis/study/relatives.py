"""Transfer from other terrains about one, measured on its own trials.

With three of its trials known, and with none, its other trials are predicted by the
model of all ground and held against a model of these three alone. A terrain with one
relative or none may be better off without: there the spread between relatives is the
prior's. Its three trials, each left out in turn, decide; where there are more relatives
they need a clear gain, as three trials are a noisy judge.
"""

import math
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from acquisition.errors import TractionError
from analysis.data.prepare import PreparedTrial
from analysis.data.samples import SampleTable, TrainingSet
from analysis.data.series import TractionSeries
from analysis.data.terrain_kinds import (
    FINE,
    FLAT,
    Value,
    grain_size,
    terrain_incline,
    terrain_kind,
)
from analysis.gp.ground import Ground
from analysis.gp.kernels import SquaredExponential
from analysis.study.all_ground import (
    GIVEN,
    AllGroundModel,
    Dissipation,
    TerrainRows,
    fit_all_ground,
)
from analysis.study.metrics import Score, score
from analysis.study.models import NEW_TRIAL, FitOptions
from analysis.study.new_trial import NewTrialModel, fit_new_trial

KNOWN = 3  # trials of a terrain that are known
FEW = 2  # relatives below which the spread between them is the prior's
_OWN_GAIN = 0.05  # nat, inner, from which on the own trials are used alone
_CLEAR_OWN_GAIN = 0.25  # the same where there are enough relatives
_INNER = 150  # rows of a terrain when own trials are left out in turn
_THIN = 5  # of the rows that are predicted every fifth
_STREAM = 4_000_000  # apart from folds, terrain fits, tables and components


@dataclass(frozen=True, slots=True)
class RelativesTask:
    """Everything that one terrain's comparison needs.

    Attributes:
        own: the three trials that are known.
        tested: every fifth row of its other trials.
        numbers: of these trials, from 0.
        others: rows of all other terrains.
        options: how the own model is fitted.
    """

    own: TerrainRows
    tested: tuple[SampleTable, ...]
    numbers: tuple[int, ...]
    others: tuple[TerrainRows, ...]
    options: FitOptions


@dataclass(frozen=True, slots=True)
class RelativesOutcome:
    """What relatives tell about the trials of one terrain.

    Attributes:
        terrain: its name.
        relatives: other terrains of its surface: stones, or plates.
        tested: numbers of its trials that were predicted, from 0.
        joint: scores on them with three own trials and all relatives.
        alone: scores with the three own trials only.
        unseen: scores with the relatives only.
        inner_joint: NLPD of the three own trials, each left out, with relatives.
        inner_alone: the same without.
        dissipation: of the prediction with relatives.
        c: of the warp [N]; None without.
        theta: hyperparameters by name.
    """

    terrain: str
    relatives: tuple[str, ...]
    tested: tuple[int, ...]
    joint: tuple[Score, ...]
    alone: tuple[Score, ...]
    unseen: tuple[Score, ...]
    inner_joint: float
    inner_alone: float
    dissipation: Dissipation
    c: float | None
    theta: Mapping[str, float]

    @property
    def has_few(self) -> bool:
        """Whether its relatives are too few to show how far relatives differ."""
        return len(self.relatives) < FEW

    @property
    def uses_relatives(self) -> bool:
        """Whether the own trials, each left out, are not clearly better alone."""
        needed = _OWN_GAIN if self.has_few else _CLEAR_OWN_GAIN
        return self.inner_joint - self.inner_alone < needed

    def numbers(self) -> dict[str, Any]:
        """Return the outcome as plain values: means over the trials."""
        scores = {
            f"{key}_{name}": float(np.mean([getattr(s, key) for s in tested]))
            for name, tested in (
                ("with_relatives", self.joint),
                ("alone", self.alone),
                ("never_recorded", self.unseen),
            )
            for key in ("nlpd", "coverage90")
        }
        return scores | {
            "relatives": list(self.relatives),
            "has_few_relatives": self.has_few,
            "uses_relatives": self.uses_relatives,
            "tested": [k + 1 for k in self.tested],
            "inner_nlpd": [self.inner_joint, self.inner_alone],
            "below_zero": self.dissipation._asdict(),
            "c": self.c,
            "theta": dict(self.theta),
        }

    @property
    def chosen(self) -> tuple[Score, ...]:
        """Scores of what is used: own trials with relatives, or alone."""
        return self.joint if self.uses_relatives else self.alone


def grounds_of(trials: Mapping[str, Sequence[TractionSeries]]) -> dict[str, Ground]:
    """Return the grounds of the terrains whose stones and incline are known."""
    grounds: dict[str, Ground] = {}
    for name, recorded in trials.items():
        kind = terrain_kind(name, [series.stones for series in recorded])
        incline = terrain_incline(name, [series.incline_deg for series in recorded])
        if incline is None:
            continue
        factors = logarithms(factors_of(recorded), recorded)
        if kind == FINE and isinstance(size := dict(factors).get("d50"), float):
            kind = f"{size:g} mm"
        if kind == FLAT or grain_size(kind) is not None:
            others = tuple(pair for pair in factors if pair[0] != "d50")
            grounds[name] = Ground(name, kind, incline, others)
    return grounds


def factors_of(recorded: Sequence[TractionSeries]) -> dict[str, Value]:
    """Return the factors that the recordings of a terrain state alike.

    One that they contradict each other in does not apply.
    """
    found: dict[str, Value] = {}
    for series in recorded:
        for name, value in series.factors.items():
            found[name] = value if found.get(name, value) == value else None
    return found


def logarithms(
    factors: Mapping[str, Value], recorded: Sequence[TractionSeries]
) -> tuple[tuple[str, Value], ...]:
    """Return factors with the logarithm of those that are compared by it.

    The grain size, d50 [mm], stays what it is: its term takes the logarithm itself.
    """
    logs = {name for series in recorded for name in series.logs} - {"d50"}
    values: dict[str, Value] = dict(factors)
    for name in logs & set(values):
        value = values[name]
        if isinstance(value, float):
            values[name] = math.log(value) if value > 0.0 else None
    return tuple(values.items())


def plan_relatives(
    trials: Mapping[str, Sequence[PreparedTrial]],
    grounds: Mapping[str, Ground],
    options: FitOptions,
    draw: int = 0,
) -> list[RelativesTask]:
    """Return a task per terrain with more than three trials and another terrain.

    None where no model of a new trial is asked for, or where the trials have inputs
    beside F_n and v_t: the model of all grounds has no place for them.

    Args:
        trials: prepared trials by terrain.
        grounds: of the terrains that are known; others take no part.
        options: how own models are fitted, and the seed of rows and of trials.
        draw: another one takes another three trials as known.
    """
    has_further = any(t.further is not None for ts in trials.values() for t in ts)
    if has_further or not NEW_TRIAL & set(options.models):
        return []
    tables = {
        name: {k: SampleTable.of([t]) for k, t in enumerate(trials[name]) if t.kept}
        for name in grounds
    }
    rows = {
        name: TerrainRows(grounds[name], tuple(own_tables.values())).thinned(GIVEN)
        for name, own_tables in tables.items()
        if own_tables
    }
    tasks: list[RelativesTask] = []
    for name, own_tables in tables.items():
        others = tuple(r for other, r in rows.items() if other != name)
        if len(own_tables) <= KNOWN or not others:
            continue
        key = (options.seed, zlib.crc32(name.encode()), draw, _STREAM)
        dice = np.random.default_rng(key)
        known = sorted(dice.permutation(list(own_tables))[:KNOWN].tolist())
        own = TerrainRows(grounds[name], tuple(own_tables[k] for k in known))
        numbers = tuple(k for k in own_tables if k not in known)
        thin = _every([own_tables[k] for k in numbers])
        tasks.append(RelativesTask(own, thin, numbers, others, options))
    return tasks


def run_relatives(task: RelativesTask) -> RelativesOutcome | None:
    """Return what relatives tell about a terrain; a pure function of the task.

    None where no model can be fitted.
    """
    try:
        unseen = fit_all_ground(task.others)
        joint = fit_all_ground((task.own, *task.others), unseen)
        alone = _alone(task)
        inner = _inner(joint, task)
    except TractionError:
        return None
    ground = task.own.ground
    is_kin = [other.ground.is_plate == ground.is_plate for other in task.others]
    return RelativesOutcome(
        terrain=ground.terrain,
        relatives=tuple(
            other.ground.terrain
            for other, kin in zip(task.others, is_kin, strict=True)
            if kin
        ),
        tested=task.numbers,
        joint=_scores(joint, ground, task.tested),
        alone=tuple(score(t.F_t, alone.predict(t.F_n, t.v_t)) for t in task.tested),
        unseen=_scores(unseen, ground, (*task.tested, *_every(task.own.trials))),
        inner_joint=inner,
        inner_alone=alone.choice.nlpd[alone.choice.chosen],
        dissipation=joint.dissipation(ground, SampleTable.joined(task.tested)),
        c=joint.c,
        theta=joint.process.describe(),
    )


def _alone(task: RelativesTask) -> NewTrialModel:
    """Return the model of the own trials alone, as a study would fit it."""
    rows, options = SampleTable.joined(task.own.trials), task.options
    key = (options.seed, zlib.crc32(task.own.ground.terrain.encode()), _STREAM)
    count = min(options.gp_points, rows.count)
    chosen = np.random.default_rng(key).choice(rows.count, count, replace=False)
    lengths = tuple(table.count for table in task.own.trials)
    training = TrainingSet(rows, lengths, chosen)
    return fit_new_trial(training, SquaredExponential(), None, options.effect)


def _inner(joint: AllGroundModel, task: RelativesTask) -> float:
    """Return the NLPD of the own trials, each left out with theta kept."""
    others = [other.thinned(_INNER) for other in task.others]
    ground, own = task.own.ground, task.own.trials
    scores: list[float] = []
    for k, table in enumerate(own):
        rest = TerrainRows(ground, (*own[:k], *own[k + 1 :])).thinned(_INNER)
        given = AllGroundModel.of(joint.process, joint.c, [rest, *others])
        model = replace(given, shapes=joint.shapes)
        scores += [s.nlpd for s in _scores(model, ground, _every([table]))]
    return float(np.mean(scores))


def _scores(
    model: AllGroundModel, ground: Ground, tables: Sequence[SampleTable]
) -> tuple[Score, ...]:
    return tuple(score(t.F_t, model.predict(ground, t.inputs)) for t in tables)


def _every(tables: Sequence[SampleTable]) -> tuple[SampleTable, ...]:
    """Return every fifth row of tables."""
    return tuple(t.take(np.arange(0, t.count, _THIN)) for t in tables)
