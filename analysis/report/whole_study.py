"""A study, and the break-away models of its trials: fitted in the same time."""

from collections.abc import Callable, Mapping, Sequence

from analysis.breakaway.model import BreakAwayModel
from analysis.data.series import TractionSeries
from analysis.data.terrain_kinds import terrain_kind
from analysis.study.crossval import Prepared
from analysis.study.jobs import Batch, Progress, Store
from analysis.study.study import (
    Study,
    StudyOptions,
    run_study_beside,
)
from analysis.terrains.export import break_away_batch

Recorded = Mapping[str, Sequence[TractionSeries]]


def run_whole_study(
    trials: Recorded,
    options: StudyOptions,
    simulated: bool,
    progress: Progress | None = None,
    store: Store | None = None,
) -> tuple[Study, Mapping[str, BreakAwayModel]]:
    """Return the study of `run_study`, and the break-away models by terrain.

    Raises:
        SettingsError: there is no trial at all.
    """
    study, ((break_away,),) = run_study_beside(
        _break_away(trials, options), trials, options, simulated, progress, store
    )
    return study, break_away


def _break_away(
    trials: Recorded, options: StudyOptions
) -> Callable[[Prepared], list[Batch]]:
    """Return what gives the task of break-away from the prepared trials."""
    kinds = {
        name: terrain_kind(name, [series.stones for series in recorded])
        for name, recorded in trials.items()
    }
    return lambda prepared: [break_away_batch(prepared, kinds, options.fit.seed)]
