"""A study, and what its report needs beside the models: fitted in the same time."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from analysis.breakaway.model import BreakAwayModel
from analysis.data.series import TractionSeries
from analysis.data.terrain_kinds import terrain_kind
from analysis.study.crossval import Prepared
from analysis.study.jobs import Batch, Progress, Shard, Store
from analysis.study.study import (
    Study,
    StudyOptions,
    run_study_beside,
    run_study_shard,
)
from analysis.terrains.export import break_away_batch
from analysis.terrains.generator_check import (
    SampledTrials,
    generator_tasks,
    judge_generator,
)

Recorded = Mapping[str, Sequence[TractionSeries]]


class FittedBeside(NamedTuple):
    """What was fitted beside the models of a study.

    Attributes:
        break_away: models of break-away, by terrain that has one.
        sampled: samples of a generator against trials left out, by terrain.
    """

    break_away: Mapping[str, BreakAwayModel]
    sampled: Mapping[str, SampledTrials]


class _Beside:
    """The tasks beside a study, and what comes of them."""

    def __init__(self, trials: Recorded, seed: int) -> None:
        self._kinds = {
            name: terrain_kind(name, [series.stones for series in recorded])
            for name, recorded in trials.items()
        }
        self._seed = seed
        self._sampled: Sequence[str] = ()

    def batches(self, prepared: Prepared) -> list[Batch]:
        tasks = generator_tasks(prepared, self._kinds, self._seed)
        self._sampled = list(tasks)
        return [
            Batch(judge_generator, list(tasks.values())),
            break_away_batch(prepared, self._kinds, self._seed),
        ]

    def fitted(
        self,
        judged: Sequence[SampledTrials | None],
        break_away: Sequence[Mapping[str, BreakAwayModel]],
    ) -> FittedBeside:
        pairs = zip(self._sampled, judged, strict=True)
        sampled = {name: found for name, found in pairs if found is not None}
        return FittedBeside(break_away[0], sampled)


def run_whole_study(
    trials: Recorded,
    options: StudyOptions,
    simulated: bool,
    progress: Progress | None = None,
    store: Store | None = None,
) -> tuple[Study, FittedBeside]:
    """Return the study of `run_study`, and what its report needs beside it.

    Raises:
        SettingsError: there is no trial at all.
    """
    beside = _Beside(trials, options.fit.seed)
    study, (judged, break_away) = run_study_beside(
        beside.batches, trials, options, simulated, progress, store
    )
    return study, beside.fitted(judged, break_away)


def run_whole_study_shard(
    trials: Recorded,
    options: StudyOptions,
    shard: Shard,
    store: Store,
    progress: Progress | None = None,
) -> int:
    """Keep one run's share of what `run_whole_study` needs; return its tasks' number.

    Raises:
        SettingsError: there is no trial at all.
    """
    beside = _Beside(trials, options.fit.seed)
    return run_study_shard(trials, options, shard, store, progress, beside.batches)
