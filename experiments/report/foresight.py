"""Foresight of a study: learnt, and scored on held-out trials."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any

import numpy as np

from analysis.breakaway.model import BreakAwayModel
from analysis.data.terrain_kinds import groups_of
from analysis.findings.held_trial import HeldTrial
from analysis.foresight.curves import ForesightCurves
from analysis.foresight.judged import JudgedForesight, JudgedTask, judge, plan_judged
from analysis.foresight.model import ForesightModel
from analysis.foresight.watching import WatchedTrial, WatchTask, watch_file
from analysis.report.page_model import ReportTable
from analysis.study.jobs import Store, run_tasks
from analysis.study.study import Study
from experiments.report.tables import foresight_tables

MOST_WATCHED = 50  # trials of a terrain: what is watched of one has megabytes


@dataclass(frozen=True, slots=True)
class StudyForesight:
    """What a study teaches foresight.

    Attributes:
        model: learnt from 50 trials of a terrain at most; None where they are too few.
        tables: what it is worth.
        numbers: the same as plain values.
        curves: what a figure shows of it; None where there were too few trials.
    """

    model: ForesightModel | None
    tables: tuple[ReportTable, ...]
    numbers: Mapping[str, Any]
    curves: ForesightCurves | None = None


def study_foresight(
    study: Study,
    trials: Mapping[str, Sequence[HeldTrial]],
    break_away: Mapping[str, BreakAwayModel],
    store: Store | None = None,
    meanwhile: Callable[[], object] = lambda: None,
) -> StudyForesight:
    """Return what the trials of a study teach, and what that is worth on others.

    Args:
        study: gives kinds.
        trials: of the study, by terrain; read anew where nothing is kept.
        break_away: models by terrain.
        store: outcomes of earlier reports.
        meanwhile: called here, once or more, while other processes learn.
    """
    few = _spread(trials)
    task = plan_judged(few, study.kinds, break_away)
    judged = judged_foresight(
        task,
        lambda: watched_trials(study, few),
        store,
        study.options.n_jobs,
        meanwhile,
    )
    if judged.curves is None:
        return StudyForesight(judged.model, (), {})
    surface = judged.surface
    numbers = {
        "slips": {name: asdict(score) for name, score in judged.slips.items()},
        "surface": None if surface is None else asdict(surface),
        "terrain_after_sliding": judged.grounds,
    }
    tables = foresight_tables(judged.slips, judged.grounds, surface)
    return StudyForesight(judged.model, tables, numbers, judged.curves)


def watched_trials(
    study: Study, trials: Mapping[str, Sequence[HeldTrial]]
) -> list[WatchedTrial]:
    """Return the trials of a study, 50 of a terrain at most, read anew and watched.

    Raises:
        TrialFileError: a file is not a sound trial any more.
    """
    surface, few = groups_of(study.kinds)["surface"], _spread(trials)
    tasks = [WatchTask(t.path, surface[n]) for n, group in few.items() for t in group]
    return run_tasks(watch_file, tasks, study.options.n_jobs)


def _spread(
    trials: Mapping[str, Sequence[HeldTrial]],
) -> dict[str, list[HeldTrial]]:
    """Return at most 50 trials of every terrain, spread evenly over all of them."""
    return {
        name: [
            group[round(k)]
            for k in np.linspace(0, len(group) - 1, min(len(group), MOST_WATCHED))
        ]
        for name, group in trials.items()
    }


def judged_foresight(
    task: JudgedTask,
    watched: Callable[[], Sequence[WatchedTrial]],
    store: Store | None,
    n_jobs: int | None = 1,
    meanwhile: Callable[[], object] = lambda: None,
) -> JudgedForesight:
    """Return what trials teach and what that is worth; from the store where it is kept.

    Args:
        task: what it follows from.
        watched: gives its trials, watched; called only where nothing is kept.
        store: outcomes of earlier reports.
        n_jobs: processes; one per core where it is None.
        meanwhile: called here, once or more, while other processes learn.
    """
    kept = None if store is None else store.get(judge, task)
    if isinstance(kept, JudgedForesight):
        return kept

    def learning(_done: int, _total: int) -> None:
        meanwhile()

    run = partial(run_tasks, workers=n_jobs, progress=learning)
    outcome = judge(watched(), task.break_away, run)
    if store is not None:
        store.put(judge, task, outcome)
    return outcome
