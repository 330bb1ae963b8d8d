"""Recognition of the windows of a study by models and limits of held-out trials.

Trial k of every terrain is judged by a classifier fitted to the trials of all other
numbers, and by rejection limits from those trials: a window beyond the limits belongs
to none of the known terrains.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from analysis.data.prepare import PreparedTrial
from analysis.data.series import Array
from analysis.terrains.classifier import (
    FLAT_GROUND,
    ROCKY_GROUND,
    fit_surface,
)
from analysis.terrains.recognition import Expert, TerrainScores, score_trial
from analysis.terrains.verdict import WindowLimits
from analysis.terrains.windows import ROUGHNESS, WINDOWS, window_features, windows_of

# Share of a terrain's own windows that may be rejected as unknown. The aim is at most
# 10 %: limits set for 10 % reject 10.2 to 10.4 % of the windows of held-out trials.
REFUSED = 0.08
_SMOOTH_PER_STRAINED = 2.0  # windows rejected as too smooth per window of high strain
SURE = 0.98  # probability at which an answer counts as certain
_BINS = 10


@dataclass(frozen=True, slots=True)
class TrialEvidence:
    """Scores of one trial under models not fitted to it, and its window features.

    Attributes:
        number: number of the trial on its terrain, from 0.
        scores: scores of every sample by every terrain's model.
        features: features of consecutive windows by size, shape (windows, features).
        overlapping: the same for overlapping windows.
    """

    number: int
    scores: TerrainScores
    features: Mapping[int, Array]
    overlapping: Mapping[int, Array]

    @classmethod
    def of(
        cls, trial: PreparedTrial, number: int, experts: Mapping[str, Expert]
    ) -> "TrialEvidence":
        """Score a trial and compute its window features."""
        windows = {size: windows_of(trial.kept, size) for size in WINDOWS}
        dense = {size: windows_of(trial.kept, size, overlap=True) for size in WINDOWS}
        return cls(
            number=number,
            scores=score_trial(trial, experts),
            features={s: window_features(trial, rows) for s, rows in windows.items()},
            overlapping={s: window_features(trial, rows) for s, rows in dense.items()},
        )

    def strains(self, terrain: str, size: int, *, overlap: bool = False) -> Array:
        """Return the mean strain of windows by a terrain's model, shape (n,)."""
        column = self.scores.strain[:, self.scores.terrains.index(terrain)]
        begins = [w.start for w in windows_of(column.size, size, overlap=overlap)]
        if not begins:
            return np.zeros(0)
        return sliding_window_view(column, size)[begins].mean(axis=1)


@dataclass(frozen=True, slots=True)
class StudyEvidence:
    """Evidence of all trials of a study.

    Attributes:
        trials: evidence by terrain.
        surface: "flat", "rocky" or the terrain's own kind, by terrain.
    """

    trials: Mapping[str, Sequence[TrialEvidence]]
    surface: Mapping[str, str]

    def labelled(
        self, without: int | None = None
    ) -> list[tuple[Mapping[int, Array], str]]:
        """Return overlapping features and surface of all trials except one number."""
        return [
            (trial.overlapping, self.surface[name])
            for name, trials in self.trials.items()
            for trial in trials
            if trial.number != without
        ]

    def limits(
        self, terrain: str, size: int, without: int | None = None
    ) -> WindowLimits:
        """Return the rejection limits of a terrain's windows.

        The limits are quantiles over all windows, at a level chosen by leaving out one
        trial at a time so that a share `REFUSED` of the windows of the trial left out
        is rejected. Terrains of stones have similar strain and share that limit; every
        terrain has its own lower limit of roughness.
        """
        own = [t for t in self.trials[terrain] if t.number != without]
        roughness = {t.number: t.overlapping[size][:, ROUGHNESS] for t in own}
        strain = {t.number: t.strains(terrain, size, overlap=True) for t in own}
        pooled: dict[int, list[Array]] = {}
        for name in self._similar_terrains(terrain):
            for trial in self.trials[name]:
                if trial.number != without:
                    strains = trial.strains(name, size, overlap=True)
                    pooled.setdefault(trial.number, []).append(strains)
        every = {number: np.concatenate(parts) for number, parts in pooled.items()}
        share = _allowed_share(
            [
                np.minimum(
                    _share_up_to(roughness[k], _without(roughness, k))
                    / _SMOOTH_PER_STRAINED,
                    _share_up_to(-strain[k], -_without(every, k)),
                )
                for k in roughness
                if len(roughness) > 1
            ]
        )
        return WindowLimits(
            _quantile(roughness.values(), share * _SMOOTH_PER_STRAINED, -np.inf),
            _quantile(every.values(), 1.0 - share, np.inf),
        )

    def _similar_terrains(self, terrain: str) -> tuple[str, ...]:
        if self.surface[terrain] != ROCKY_GROUND:
            return (terrain,)
        return self.of_surface(ROCKY_GROUND)

    def of_surface(self, surface: str) -> tuple[str, ...]:
        """Return the terrains of a surface."""
        return tuple(name for name in self.trials if self.surface[name] == surface)


def _allowed_share(parts: Sequence[Array]) -> float:
    """Return the share of windows to reject by the limit of strain.

    Args:
        parts: for every held-out trial, the smallest such share that rejects each
            window; without any, the two limits are assumed to reject different windows.
    """
    disjoint = REFUSED / (1.0 + _SMOOTH_PER_STRAINED)
    return min(_quantile(parts, REFUSED, disjoint), 1.0 / _SMOOTH_PER_STRAINED)


def _share_up_to(values: Array, others: Array) -> Array:
    """Return the share of `others` at or below each value, shape (n,); 1 if empty."""
    if others.size == 0:
        return np.ones(values.shape)
    return np.searchsorted(np.sort(others), values, "right") / others.size


def _without(parts: Mapping[int, Array], number: int) -> Array:
    return np.concatenate([part for k, part in parts.items() if k != number])


def _quantile(parts: Iterable[Array], share: float, empty: float) -> float:
    values = np.concatenate([np.zeros(0), *parts])
    return float(np.quantile(values, share)) if values.size else empty


@dataclass(frozen=True, slots=True)
class SurfaceProbability:
    """Classification of a window of a held-out trial.

    Attributes:
        terrain: terrain of the trial.
        surface: the truth, "flat" or "rocky".
        rocky: probability of rocky ground.
    """

    terrain: str
    surface: str
    rocky: float

    @property
    def answer(self) -> str:
        """The likelier surface."""
        return ROCKY_GROUND if self.rocky > 0.5 else FLAT_GROUND


def surface_probabilities(
    evidence: StudyEvidence, size: int
) -> list[SurfaceProbability]:
    """Return the classifier's probabilities for all windows of held-out trials."""
    labelled = {
        name: trials
        for name, trials in evidence.trials.items()
        if evidence.surface[name] in (FLAT_GROUND, ROCKY_GROUND)
    }
    probabilities = []
    for number in sorted({t.number for trials in labelled.values() for t in trials}):
        model = fit_surface(evidence.labelled(number), size)
        if model is None:
            continue
        probabilities += [
            SurfaceProbability(name, evidence.surface[name], float(rocky))
            for name, trials in labelled.items()
            for trial in trials
            if trial.number == number and len(trial.features[size])
            for rocky in model.probabilities(trial.features[size])
        ]
    return probabilities


@dataclass(frozen=True, slots=True)
class Calibration:
    """Calibration of the probabilities of flat and rocky ground.

    Attributes:
        error: expected calibration error over ten bins, both surfaces weighted
            equally.
        sure: share of windows answered with a probability of 98 % or more.
        sure_and_wrong: share of windows answered with 98 % or more, but wrongly.
    """

    error: float
    sure: float
    sure_and_wrong: float


def calibration_of(windows: Sequence[SurfaceProbability]) -> Calibration:
    """Return the calibration of the probabilities of windows."""
    p = np.array([window.rocky for window in windows])
    is_rocky = np.array([window.surface == ROCKY_GROUND for window in windows])
    share = float(is_rocky.mean())
    weight = np.where(is_rocky, 0.5 / max(share, 1e-9), 0.5 / max(1.0 - share, 1e-9))
    bin_index = np.minimum((p * _BINS).astype(int), _BINS - 1)
    off = np.bincount(bin_index, weight * (p - is_rocky), _BINS)
    is_sure = np.maximum(p, 1.0 - p) >= SURE
    return Calibration(
        error=float(np.abs(off).sum() / weight.sum()),
        sure=float(is_sure.mean()),
        sure_and_wrong=float((is_sure & ((p > 0.5) != is_rocky)).mean()),
    )


@dataclass(frozen=True, slots=True)
class Exclusion:
    """Rates at which windows are rejected as none of the known terrains.

    Attributes:
        false_alarms: share of windows rejected although their terrain is known.
        flat_among_rocky: share of windows of flat ground rejected when only rocky
            terrains are known; None if either is missing.
        rocky_among_flat: the reverse.
    """

    false_alarms: float | None
    flat_among_rocky: float | None
    rocky_among_flat: float | None


def exclusion_of(evidence: StudyEvidence, size: int) -> Exclusion:
    """Return the rejection rates of windows of a size by limits of other trials."""
    rocky, flat = (
        evidence.of_surface(surface) for surface in (ROCKY_GROUND, FLAT_GROUND)
    )
    every = list(evidence.trials)
    return Exclusion(
        false_alarms=_excluded(evidence, every, every, size),
        flat_among_rocky=_excluded(evidence, rocky, flat, size),
        rocky_among_flat=_excluded(evidence, flat, rocky, size),
    )


def _excluded(
    evidence: StudyEvidence, known: Sequence[str], tested: Sequence[str], size: int
) -> float | None:
    """Return the share of windows of `tested` that are rejected by `known` terrains."""
    limits: dict[tuple[str, int], WindowLimits] = {}
    verdicts: list[bool] = []
    for trial in (trial for name in tested for trial in evidence.trials[name]):
        # a terrain with fewer trials has no model for this trial number
        strains = {
            name: trial.strains(name, size) for name in known if _has(trial, name)
        }
        for k, rows in enumerate(trial.scores.windows(size)):
            if not strains:
                continue
            best = _likeliest(trial.scores, rows, strains)
            key = best, trial.number
            if key not in limits:
                limits[key] = evidence.limits(best, size, trial.number)
            roughness = float(trial.features[size][k, ROUGHNESS])
            verdicts.append(limits[key].exclude(roughness, float(strains[best][k])))
    return float(np.mean(verdicts)) if verdicts else None


def _has(trial: TrialEvidence, terrain: str) -> bool:
    return terrain in trial.scores.terrains


def _likeliest(scores: TerrainScores, rows: slice, known: Iterable[str]) -> str:
    total = scores.log_density[rows].sum(axis=0)
    return max(known, key=lambda name: float(total[scores.terrains.index(name)]))
