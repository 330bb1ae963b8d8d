"""Foresight of a study: learnt and scored on held-out trials; of a trial: replayed."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.errors import SettingsError
from acquisition.sample import Record
from acquisition.schema import FORESIGHT
from acquisition.trial_file.reader import TrialReader
from analysis.breakaway.model import BreakAwayModel
from analysis.data.load import load_trial
from analysis.data.terrain_kinds import groups_of
from analysis.findings.held_trial import HeldTrial
from analysis.foresight.curves import ForesightCurves
from analysis.foresight.judged import JudgedForesight, JudgedTask, judge, plan_judged
from analysis.foresight.model import ForesightModel, RigIdentity
from analysis.foresight.watching import WatchedTrial, WatchTask, watch_file
from analysis.report.page_model import ReportTable
from analysis.study.jobs import Store, run_tasks
from analysis.study.study import Study
from experiments.report.tables import foresight_tables
from experiments.rig.foresight import ForesightSource, state_record, states_of

OPEN_END = 25  # last states that a process may not have come to at the end


@dataclass(frozen=True, slots=True)
class StudyForesight:
    """What a study teaches foresight.

    Attributes:
        model: learnt from all trials; None where they are too few.
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
    task = plan_judged(trials, study.kinds, break_away)
    judged = judged_foresight(
        task,
        lambda: watched_trials(study, trials),
        *(store, study.options.n_jobs, meanwhile),
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
    """Return the trials of a study, read anew and watched.

    Raises:
        TrialFileError: a file is not a sound trial any more.
    """
    surface = groups_of(study.kinds)["surface"]
    tasks = [WatchTask(t.path, surface[n]) for n, of in trials.items() for t in of]
    return run_tasks(watch_file, tasks, study.options.n_jobs)


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


@dataclass(frozen=True, slots=True)
class ForesightReplay:
    """What was foreseen while a trial was recorded, computed anew from the record.

    Attributes:
        recorded: number of states in the record.
        computed: number of states that the record gives.
        equal: number of states that are there and equal bit for bit.
        first_other: cycle of the first state that is another one, or has no other;
            None where all are equal.
        is_same_source: it was foreseen with the same models.
    """

    recorded: int
    computed: int
    equal: int
    first_other: int | None
    is_same_source: bool

    @property
    def is_proved(self) -> bool:
        """Whether every recorded state is the computed one, the last few left open."""
        is_whole = self.computed - self.recorded <= OPEN_END
        return self.first_other is None and is_whole and self.is_same_source


def replay_foresight(path: Path, source: ForesightSource) -> ForesightReplay:
    """Compute anew what was foreseen in a trial, sample by sample, and compare.

    Raises:
        TrialFileError: the file is no sound trial.
        SettingsError: nothing was foreseen in it.
    """
    trial, reader = load_trial(path), TrialReader(path)
    if not reader.has_foresight:
        raise SettingsError(
            f"{trial.name}: it has no foresight channel.",
            hint="Record with one: traction run TERRAIN --foresight FILE",
        )
    recorded = reader.foresight().data
    rig = RigIdentity.of(trial.metadata["trial"])
    along: list[float] = trial.frame.axes()[0].tolist()
    states = states_of(source.started(rig), trial.cycles, along)
    computed = np.frombuffer(b"".join(map(state_record, states)), FORESIGHT.dtype)
    return _compare(recorded, computed, reader, source)


def _compare(
    recorded: Record, computed: Record, reader: TrialReader, source: ForesightSource
) -> ForesightReplay:
    stamped = computed.copy()
    count = min(len(recorded), len(stamped))
    for name in ("sec", "nanosec"):  # set by the writer, from host_ns
        stamped[name][:count] = recorded[name][:count]
    size = FORESIGHT.size
    ours, theirs = stamped[:count].tobytes(), recorded[:count].tobytes()
    is_equal = [
        ours[i * size : (i + 1) * size] == theirs[i * size : (i + 1) * size]
        for i in range(count)
    ]
    other = is_equal.index(False) if False in is_equal else None
    first = None if other is None else int(recorded["cycle"][other])
    if first is None and len(recorded) > count:
        first = int(recorded["cycle"][count])
    digest = reader.metadata.get("foresight", {}).get("sha256", "")
    return ForesightReplay(
        recorded=len(recorded),
        computed=len(computed),
        equal=sum(is_equal),
        first_other=first,
        is_same_source=digest == source.digest,
    )
