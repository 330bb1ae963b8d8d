"""Foresight of a study: learnt from all its trials, judged on held-out ones.

Training takes longer than all else of a second report, so the outcome may be kept: it
is known by digests of all that was read of the trials, never by their names alone.
"""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from analysis.breakaway.model import BreakAwayModel
from analysis.data.load import RecordedTrial
from analysis.data.series import Array
from analysis.data.terrain_kinds import groups_of
from analysis.foresight.curves import (
    ForesightCurves,
    ForesightExcerpt,
    foresight_curves,
)
from analysis.foresight.engine import ForesightFlag
from analysis.foresight.ground import GroundLaw, GroundModel
from analysis.foresight.held_out import LearningTasks, Run, learn, run_here
from analysis.foresight.logistic import RidgeLogistic
from analysis.foresight.model import ForesightModel, Provenance, RigIdentity, SlipModel
from analysis.foresight.scores import (
    GroundScore,
    SlipScore,
    score_ground,
    score_slips,
)
from analysis.foresight.ticks import ForesightRun
from analysis.foresight.training import fit_foresight
from analysis.foresight.watching import WatchedTrial

LEAST_TRIALS = 5  # of a study: as many as there are folds
SLID = (25, 50, 100, 200)  # ticks of sliding after which the ground is asked

GroundRows = Mapping[str, Mapping[str, Sequence[float]]]


@dataclass(frozen=True, slots=True, eq=False)
class JudgedForesight:
    """What a study teaches foresight, and what that is worth on held-out trials.

    Attributes:
        model: learnt from all trials; None where they are too few.
        slips: scores by terrain, and of all that slip together; empty where there were
            too few slips or trials.
        surface: how flat and rocky ground are told apart; None with one of them only.
        grounds: mean probability of the own "terrain", its "surface" and "none" after
            `SLID` ticks of sliding, by terrain.
        curves: what a figure shows of it; None where there were too few trials.
    """

    model: ForesightModel | None
    slips: Mapping[str, SlipScore] = field(default_factory=dict)
    surface: GroundScore | None = None
    grounds: GroundRows = field(default_factory=dict)
    curves: ForesightCurves | None = None


JUDGED_TYPES: Mapping[str, type] = {
    kind.__name__: kind
    for kind in (
        ForesightCurves,
        ForesightExcerpt,
        ForesightModel,
        GroundLaw,
        GroundModel,
        GroundScore,
        JudgedForesight,
        Provenance,
        RidgeLogistic,
        RigIdentity,
        SlipModel,
        SlipScore,
    )
}


@dataclass(frozen=True, slots=True)
class WatchedSource:
    """What a watched trial is made from.

    Attributes:
        terrain: its name.
        name: of the trial.
        surface: "flat", "rocky" or a word of its own.
        rig: foot and rig.
        seed: of the simulation, "" where there was none.
        digest: SHA-256 of the samples, the axes and the measured motion.
    """

    terrain: str
    name: str
    surface: str
    rig: RigIdentity
    seed: str
    digest: str


@dataclass(frozen=True, slots=True)
class JudgedTask:
    """Everything that the outcome follows from.

    Attributes:
        trials: in the order of the study.
        break_away: models by terrain.
    """

    trials: tuple[WatchedSource, ...]
    break_away: Mapping[str, BreakAwayModel]


class DigestedTrial(Protocol):
    """What a trial that was watched is known by."""

    @property
    def terrain(self) -> str:
        """Name of the terrain."""
        ...

    @property
    def name(self) -> str:
        """Session and trial."""
        ...

    @property
    def metadata(self) -> dict[str, dict[str, str]]:
        """Metadata by name."""
        ...

    @property
    def digest(self) -> str:
        """As of `digest_of`."""
        ...


def digest_of(trial: RecordedTrial) -> str:
    """Return the SHA-256 of all arrays that `watch` reads of a trial."""
    read = [trial.cycles[k] for k in ("cycle", "host_ns", "foot_position", "traction")]
    digest = hashlib.sha256()
    for array in (*read, trial.frame.axes(), trial.t, trial.traction):
        digest.update(f"{array.dtype.str}{array.shape}".encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def source_of(trial: DigestedTrial, surface: str) -> WatchedSource:
    """Return what a watched trial is made from."""
    metadata = trial.metadata["trial"]
    rig, seed = RigIdentity.of(metadata), metadata.get("seed", "")
    return WatchedSource(trial.terrain, trial.name, surface, rig, seed, trial.digest)


def plan_judged(
    trials: Mapping[str, Sequence[DigestedTrial]],
    kinds: Mapping[str, str],
    break_away: Mapping[str, BreakAwayModel],
) -> JudgedTask:
    """Return the task of a study's trials.

    Args:
        trials: of the study, by terrain.
        kinds: kind by terrain, as of `terrain_kind`.
        break_away: models by terrain.
    """
    surface = groups_of(kinds)["surface"]
    sources = [source_of(t, surface[name]) for name, own in trials.items() for t in own]
    return JudgedTask(tuple(sources), dict(break_away))


def judge(
    watched: Sequence[WatchedTrial],
    break_away: Mapping[str, BreakAwayModel],
    run: Run = run_here,
) -> JudgedForesight:
    """Return what trials teach, each foreseen by models that have not seen it.

    Args:
        watched: the trials.
        break_away: models by terrain.
        run: calls the function with every task, in any order and wherever it likes.
    """
    if len(watched) < LEAST_TRIALS:
        return JudgedForesight(fit_foresight(watched))
    whole, *folds = run(learn, LearningTasks(watched, break_away))
    if whole.model is None:
        return JudgedForesight(None)
    runs = [run for fold in folds for run in fold.runs]
    return JudgedForesight(
        model=whole.model,
        slips=_slip_scores(runs) if whole.model.slip is not None else {},
        surface=score_ground([fold.answers for fold in folds]),
        grounds=_ground_rows(runs),
        curves=foresight_curves(runs),
    )


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


def _ground_rows(runs: Sequence[ForesightRun]) -> GroundRows:
    """Return mean probability of the own terrain and surface by time slid."""
    rows: dict[str, dict[str, tuple[float, ...]]] = {}
    for name in dict.fromkeys(run.trial.terrain for run in runs):
        own = [shares for r in runs if r.trial.terrain == name if (shares := _own(r))]
        if own:
            means = _means(np.array(own))
            names = ("terrain", "surface", "none")
            rows[name] = dict(zip(names, map(tuple, means.tolist()), strict=True))
    return rows


def _means(values: Array) -> Array:
    """Return means over the first axis of what is known; NaN where nothing is."""
    is_known = ~np.isnan(values)
    with np.errstate(invalid="ignore"):
        return np.where(is_known, values, 0.0).sum(axis=0) / is_known.sum(axis=0)


def _own(run: ForesightRun) -> list[list[float]]:
    """Return probabilities of the own terrain, its surface and none after `SLID`."""
    if run.trial.terrain not in run.terrains:
        return []
    index = run.terrains.index(run.trial.terrain)
    own = run.trial.surface
    alike = [k for k, surface in enumerate(run.surfaces) if surface == own]
    wanted = int(ForesightFlag.SLIDING)
    sliding = [state for state in run.states if state.flags & wanted]
    states = [sliding[n - 1] if n <= len(sliding) else None for n in SLID]
    terrain = [np.nan if s is None else s.terrains[index] for s in states]
    none = [np.nan if s is None else s.none for s in states]
    known = [np.nan if s is None else _part(s.terrains, alike) for s in states]
    return [terrain, known, none]


def _part(shares: Sequence[float], chosen: Sequence[int]) -> float:
    """Return the part that the chosen terrains have of all known ones."""
    total = sum(shares)
    return sum(shares[k] for k in chosen) / total if total > 0.0 else float("nan")
