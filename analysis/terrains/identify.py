"""Terrain classification of a study by models of held-out trials.

Windows of motion are attributed to a terrain by two rules: the largest log density of
`recognition`, and the smallest mean absolute error, which is the paper's. A third rule,
the `classifier` fitted to the trials of other numbers, decides flat or rocky.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from analysis.data.prepare import PreparedTrial
from analysis.data.recorded_factors import FOOT
from analysis.data.terrain_kinds import class_labels
from analysis.study.models import GP_SE
from analysis.study.study import Study
from analysis.study.tasks import run_tasks
from analysis.study.terrain_fit import TerrainResult
from analysis.study.worker_processes import running_workers
from analysis.terrains.classifier import (
    ROCKY_GROUND,
    SurfaceClassifier,
    fit_surfaces,
)
from analysis.terrains.evidence import (
    Calibration,
    Exclusion,
    StudyEvidence,
    TrialEvidence,
    calibration_of,
    exclusion_of,
    surface_probabilities,
)
from analysis.terrains.recognition import (
    Expert,
    Predictor,
    neighbour_correlation,
)
from analysis.terrains.verdict import WindowLimits
from analysis.terrains.windows import WINDOWS

KEPT_PER_SECOND = 100  # kept samples per second of motion
# scores (trial by expert, 12 ms each) up to which no processes are started (2 s)
_SCORES_HERE = 200


@dataclass(frozen=True, slots=True)
class Confusion:
    """Confusion matrix of windows.

    Attributes:
        names: the m classes.
        counts: number of windows; rows the truth, columns the answer; shape (m, m).
    """

    names: tuple[str, ...]
    counts: np.ndarray

    @property
    def accuracy(self) -> float:
        """Balanced accuracy: mean recall over the classes; NaN without windows."""
        totals = self.counts.sum(axis=1)
        present = totals > 0
        if not present.any():
            return float("nan")
        return float((self.counts.diagonal()[present] / totals[present]).mean())


def confusion_of(pairs: Sequence[tuple[str, str]]) -> Confusion:
    """Count (truth, answer) pairs."""
    names = tuple(
        dict.fromkeys(name for pair in zip(*pairs, strict=True) for name in pair)
    )
    counts = np.zeros((len(names), len(names)), np.int64)
    for truth, answer in pairs:
        counts[names.index(truth), names.index(answer)] += 1
    return Confusion(names, counts)


@dataclass(frozen=True, slots=True)
class Identification:
    """Results of terrain classification in a study.

    Attributes:
        rho: correlation of neighbouring residuals by terrain.
        by_density: confusions by window size [kept samples] and level ("terrain",
            "stones", "surface"), by posterior.
        by_error: the same by the smallest mean absolute error, the paper's rule.
        by_features: the same by the classifier, level "surface" only.
        limits: rejection limits by window size and terrain.
        calibrations: calibration of the classifier's probabilities by window size.
        exclusions: rejection rates of unknown ground by window size.
        classifier: classifier of flat and rocky ground fitted to all trials; None if
            only one of them occurs.
        rocky: names of the terrains of stones.
    """

    rho: Mapping[str, float]
    by_density: Mapping[int, Mapping[str, Confusion]]
    by_error: Mapping[int, Mapping[str, Confusion]]
    by_features: Mapping[int, Mapping[str, Confusion]]
    limits: Mapping[int, Mapping[str, WindowLimits]]
    calibrations: Mapping[int, Calibration]
    exclusions: Mapping[int, Exclusion]
    classifier: SurfaceClassifier | None
    rocky: tuple[str, ...]

    @property
    def stones(self) -> int:
        """Number of the terrains of stones."""
        return len(self.rocky)

    def exact_stones(self, size: int) -> float | None:
        """Return the share of windows on stones whose own terrain is the likeliest.

        By log density; None with fewer than two terrains of stones or no windows.
        """
        confusion = self.by_density[size]["terrain"]
        rows = [k for k, name in enumerate(confusion.names) if name in self.rocky]
        total = float(confusion.counts[rows].sum())
        if len(rows) < 2 or total == 0.0:
            return None
        return float(confusion.counts[rows, rows].sum()) / total

    @property
    def levels(self) -> tuple[str, ...]:
        """Levels of classification: terrain, stones, surface and stated factors."""
        return tuple(next(iter(self.by_density.values())))

    @property
    def sizes(self) -> tuple[int, ...]:
        """Window sizes of which at least one trial has a window."""
        return tuple(
            size
            for size, levels in self.by_density.items()
            if levels["terrain"].counts.any()
        )

    @property
    def rules(self) -> dict[str, Mapping[int, Mapping[str, Confusion]]]:
        """Confusions by the name of the rule."""
        return {
            "log density": self.by_density,
            "smallest error": self.by_error,
            "features": self.by_features,
        }

    def numbers(self) -> dict[str, Any]:
        """Return everything as plain values, for fits.json."""
        return {
            "windows_samples": list(self.by_density),
            "by_density": _plain(self.by_density),
            "by_error": _plain(self.by_error),
            "by_features": _plain(self.by_features),
            "neighbour_correlation": dict(self.rho),
            "calibration": {str(k): asdict(c) for k, c in self.calibrations.items()},
            "exclusion": {str(k): asdict(e) for k, e in self.exclusions.items()},
        }


def _plain(rule: Mapping[int, Mapping[str, Confusion]]) -> dict[str, Any]:
    return {
        str(size): {
            level: {
                "names": list(confusion.names),
                "counts": confusion.counts.tolist(),
                "recognised": confusion.accuracy,
            }
            for level, confusion in levels.items()
        }
        for size, levels in rule.items()
    }


def identify_study(study: Study) -> Identification | None:
    """Classify the windows of held-out trials.

    Trial k of every terrain is scored by the models of fold k, Gaussian processes with
    the SE kernel. None if no fold has that model for at least two terrains.
    """
    rho = _correlations(study)
    evidence = _evidence(study, rho)
    if len(evidence.trials) < 2:
        return None
    groups = class_labels(study.kinds) | words_of(study)
    density, error = _by_models(evidence, groups)
    probabilities = {size: surface_probabilities(evidence, size) for size in WINDOWS}
    windows = {size: answers for size, answers in probabilities.items() if answers}
    return Identification(
        rho=rho,
        by_density=density,
        by_error=error,
        by_features={
            size: {"surface": confusion_of([(p.surface, p.answer) for p in answers])}
            for size, answers in windows.items()
        },
        limits={
            size: {name: evidence.limits(name, size) for name in evidence.trials}
            for size in WINDOWS
        },
        calibrations={size: calibration_of(p) for size, p in windows.items()},
        exclusions={size: exclusion_of(evidence, size) for size in WINDOWS},
        classifier=fit_surfaces(evidence.labelled()),
        rocky=evidence.of_surface(ROCKY_GROUND),
    )


def _by_models(
    evidence: StudyEvidence, groups: Mapping[str, Mapping[str, str]]
) -> tuple[dict[int, dict[str, Confusion]], dict[int, dict[str, Confusion]]]:
    """Return the confusions by log density and by smallest error."""
    density: dict[int, dict[str, Confusion]] = {}
    error: dict[int, dict[str, Confusion]] = {}
    for size in WINDOWS:
        windows = [
            (truth, trial.scores, rows)
            for truth, trials in evidence.trials.items()
            for trial in trials
            for rows in trial.scores.windows(size)
        ]
        density[size] = {
            level: confusion_of(
                [
                    (groups[level][t], s.likeliest_group(r, groups[level]))
                    for t, s, r in windows
                ]
            )
            for level in groups
        }
        error[size] = {
            level: confusion_of(
                [
                    (groups[level][t], groups[level][s.least_error(r)])
                    for t, s, r in windows
                ]
            )
            for level in groups
        }
    return density, error


def words_of(study: Study) -> dict[str, dict[str, str]]:
    """Return the text values of every factor by terrain, if all state it and it varies.

    The foot is included if the experiment has factors of its own.
    """
    stated = {name: result.factors for name, result in study.terrains.items()}
    names = dict.fromkeys(name for factors in stated.values() for name in factors)
    words = {
        name: {
            t: str(f[name]) for t, f in stated.items() if isinstance(f.get(name), str)
        }
        for name in (names if set(names) - {FOOT} else ())
    }
    return {
        name: of_terrain
        for name, of_terrain in words.items()
        if len(of_terrain) == len(stated) and len(set(of_terrain.values())) > 1
    }


def _correlations(study: Study) -> dict[str, float]:
    """Return rho of every terrain from held-out trials."""
    return {
        name: neighbour_correlation(
            [
                (trial, predictor(trial.F_n, trial.v_t))
                for trial, predictor in _held_out(result)
            ]
        )
        for name, result in study.terrains.items()
    }


def _held_out(result: TerrainResult) -> list[tuple[PreparedTrial, Predictor]]:
    return [
        (result.trials[k], fold.model.predict) for k, fold in result.left_out(GP_SE)
    ]


def _evidence(study: Study, rho: Mapping[str, float]) -> StudyEvidence:
    """Score every trial by the models of the folds with its number."""
    experts: dict[int, dict[str, Expert]] = {}
    for name, result in study.terrains.items():
        for k, fold in result.left_out(GP_SE):
            of_trial = experts.setdefault(k, {})
            of_trial[name] = Expert(fold.model.predict, rho[name])
    tasks = [
        ScoreTask(trial, k, experts[k])
        for name, result in study.terrains.items()
        for k, trial in enumerate(result.trials)
        if name in experts.get(k, {}) and len(experts[k]) > 1 and trial.kept
    ]
    scored: dict[str, list[TrialEvidence]] = {}
    scores = sum(len(task.experts) for task in tasks)
    workers = study.options.n_jobs
    if workers is None and scores <= _SCORES_HERE:
        workers = running_workers()
    done = run_tasks(run_score, tasks, workers)
    for task, evidence in zip(tasks, done, strict=True):
        scored.setdefault(task.trial.terrain, []).append(evidence)
    return StudyEvidence(scored, class_labels(study.kinds)["surface"])


@dataclass(frozen=True, slots=True)
class ScoreTask:
    """A trial, its number and the experts that score it."""

    trial: PreparedTrial
    number: int
    experts: Mapping[str, Expert]


def run_score(task: ScoreTask) -> TrialEvidence:
    """Score a trial by every expert and compute its window features."""
    return TrialEvidence.of(task.trial, task.number, task.experts)
