"""Foresight of a study: learnt and scored on held-out trials; of a trial: replayed."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from acquisition import FORESIGHT, Record, SettingsError
from acquisition.trial_file import TrialReader
from analysis.data import RecordedTrial, load_trial
from analysis.foresight import (
    ForesightFlag,
    ForesightModel,
    ForesightRun,
    RigIdentity,
    SlipScore,
    fit_foresight,
    fit_ground,
    folds_of,
    foresight_curves,
    hold_out,
    score_ground,
    score_slips,
    watch_all,
)
from analysis.report import ReportFigure, ReportTable, foresight_figure
from analysis.study import Study
from analysis.terrains import break_away_of
from experiments.report.tables import SLID, foresight_tables
from experiments.rig import ForesightSource, state_record, states_of

LEAST_TRIALS = 5  # of a study: as many as there are folds
OPEN_END = 25  # last states that a process may not have come to at the end


@dataclass(frozen=True, slots=True)
class StudyForesight:
    """What a study teaches foresight.

    Attributes:
        model: learnt from all trials; None where they are too few.
        tables: what it is worth.
        numbers: the same as plain values.
        figures: what a page shows of it.
    """

    model: ForesightModel | None
    tables: tuple[ReportTable, ...]
    numbers: Mapping[str, Any]
    figures: tuple[ReportFigure, ...] = ()


def study_foresight(
    study: Study,
    trials: Mapping[str, Sequence[RecordedTrial]],
    progress: Callable[[], object] = lambda: None,
    *,
    with_pdf: bool = False,
) -> StudyForesight:
    """Return what the trials of a study teach, and what that is worth on others.

    Args:
        study: gives kinds and break-away models.
        trials: recorded trials by terrain.
        progress: called after every fold.
        with_pdf: figures are wanted as PDF, too.
    """
    watched = watch_all(trials, study.kinds)
    model = fit_foresight(watched)
    if model is None or len(watched) < LEAST_TRIALS:
        return StudyForesight(model, (), {})
    runs = hold_out(watched, break_away_of(study), progress)
    scores = _slip_scores(runs) if model.slip is not None else {}
    ground = score_ground(
        [(fit_ground(rest), tested) for tested, rest in folds_of(watched)]
    )
    grounds = _ground_rows(runs)
    numbers = {
        "slips": {name: asdict(score) for name, score in scores.items()},
        "surface": None if ground is None else asdict(ground),
        "terrain_after_sliding": grounds,
    }
    tables = foresight_tables(scores, grounds, ground)
    figure = foresight_figure(
        foresight_curves(runs), is_simulated=study.simulated, with_pdf=with_pdf
    )
    figures = () if figure is None else (figure,)
    return StudyForesight(model, tables, numbers, figures)


def _slip_scores(runs: Sequence[ForesightRun]) -> dict[str, SlipScore]:
    """Return scores by terrain, and of all that slip together."""
    scores: dict[str, SlipScore] = {}
    for name in dict.fromkeys(run.trial.terrain for run in runs):
        scores[name] = score_slips([r for r in runs if r.trial.terrain == name])
    slipping = {name for name, score in scores.items() if score.onsets}
    together = [run for run in runs if run.trial.terrain in slipping]
    if len(slipping) > 1:
        scores["all that slip"] = score_slips(together)
    return scores


def _ground_rows(runs: Sequence[ForesightRun]) -> dict[str, dict[str, list[float]]]:
    """Return mean probability of the own terrain and surface by time slid."""
    rows: dict[str, dict[str, list[float]]] = {}
    for name in dict.fromkeys(run.trial.terrain for run in runs):
        own = [shares for r in runs if r.trial.terrain == name if (shares := _own(r))]
        if own:
            means = np.nanmean(np.array(own), axis=0)
            names = ("terrain", "surface", "none")
            rows[name] = dict(zip(names, means.tolist(), strict=True))
    return rows


def _own(run: ForesightRun) -> list[list[float]]:
    """Return probabilities of the own terrain, its surface and none after `SLID`."""
    if run.trial.terrain not in run.terrains:
        return []
    place = run.terrains.index(run.trial.terrain)
    own = run.trial.surface
    alike = [k for k, surface in enumerate(run.surfaces) if surface == own]
    wanted = int(ForesightFlag.SLIDING)
    sliding = [state for state in run.states if state.flags & wanted]
    states = [sliding[n - 1] if n <= len(sliding) else None for n in SLID]
    terrain = [np.nan if s is None else s.terrains[place] for s in states]
    none = [np.nan if s is None else s.none for s in states]
    known = [np.nan if s is None else _part(s.terrains, alike) for s in states]
    return [terrain, known, none]


def _part(shares: Sequence[float], chosen: Sequence[int]) -> float:
    """Return the part that the chosen terrains have of all known ones."""
    total = sum(shares)
    return sum(shares[k] for k in chosen) / total if total > 0.0 else float("nan")


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
