"""Verdicts on windows of a trial: likeliest terrain, flat or rocky, or none.

A window belongs to none of the known terrains if its strain under the likeliest model
exceeds that of nearly all windows of that terrain, or if it is smoother than nearly all
of them: a plate fits within the wide bands of stones and differs only by its lack of
roughness. Terrains of stones are so similar that the likeliest one only stands for the
group; `surface`, flat or rocky, is what can be decided.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from analysis.data.prepare import PreparedTrial
from analysis.data.series import Array
from analysis.data.terrain_kinds import class_labels
from analysis.terrains.classifier import FLAT_GROUND, ROCKY_GROUND
from analysis.terrains.known import KnownTerrain, TerrainDatabase
from analysis.terrains.logistic import RidgeLogistic
from analysis.terrains.recognition import Expert, TerrainScores, score_trial
from analysis.terrains.windows import ROUGHNESS, window_features

NONE = "none"  # none of the known terrains


@dataclass(frozen=True, slots=True)
class WindowEvidence:
    """Verdict on one window.

    Attributes:
        t: time of the last sample [s].
        posterior: probability of each terrain, in the order of the database.
        best: the likeliest terrain, or "none".
        surface: "flat", "rocky" or "none"; or the likeliest terrain's own kind.
        rocky: probability of rocky ground by the classifier; None without one.
    """

    t: float
    posterior: tuple[float, ...]
    best: str
    surface: str
    rocky: float | None


@dataclass(frozen=True, slots=True)
class Recognition:
    """Verdict on a trial.

    Attributes:
        terrains: names in the order of the database.
        moments: verdict on every window.
        posterior: probability of each terrain after the whole trial.
        best: terrain of the whole trial, or "none".
        least_error: terrain with the smallest error: the paper's rule.
        surface: majority over the windows: "flat", "rocky", "none".
    """

    terrains: tuple[str, ...]
    moments: tuple[WindowEvidence, ...]
    posterior: tuple[float, ...]
    best: str
    least_error: str
    surface: str


@dataclass(frozen=True, slots=True)
class WindowLimits:
    """Rejection limits of a terrain for windows of one size.

    Attributes:
        roughness: smallest log sd of F_t about a line in F_n [nat].
        strain: largest mean squared error over the predicted variance.
    """

    roughness: float = -np.inf
    strain: float = np.inf

    def exclude(self, roughness: float, strain: float) -> bool:
        """Whether a window is too smooth or its strain is too large."""
        return roughness < self.roughness or strain > self.strain


def recognise(
    trial: PreparedTrial, database: TerrainDatabase, window: int = 100
) -> Recognition | None:
    """Attribute a trial to a terrain of `database`; None without a window.

    The verdict is "none" if most windows belong to none of the known terrains.

    Args:
        trial: prepared trial; its kept samples are used.
        database: the known terrains.
        window: window size [kept samples]: 50, 100 or 200.
    """
    scores = score_trial(
        trial,
        {
            name: Expert(terrain.prediction, terrain.rho)
            for name, terrain in database.terrains.items()
        },
    )
    windows = scores.windows(window)
    if not windows:
        return None
    rules = _WindowRules.of(database, window)
    moments = [
        rules.verdict(_Window(trial, scores, rows, row))
        for rows, row in zip(windows, window_features(trial, windows), strict=True)
    ]
    whole = slice(0, len(scores.log_density))
    rejected = sum(moment.best == NONE for moment in moments)
    is_none = rejected > 0.5 * len(moments)
    surfaces = [moment.surface for moment in moments]
    return Recognition(
        terrains=scores.terrains,
        moments=tuple(moments),
        posterior=tuple(scores.posterior(whole).tolist()),
        best=NONE if is_none else scores.likeliest(whole),
        least_error=scores.least_error(whole),
        surface=max(dict.fromkeys(surfaces), key=surfaces.count),
    )


@dataclass(frozen=True, slots=True)
class _Window:
    """A window of a trial: its kept samples and features."""

    trial: PreparedTrial
    scores: TerrainScores
    rows: slice
    features: Array


@dataclass(frozen=True, slots=True)
class _WindowRules:
    """Limits and classifier for windows of one size.

    Attributes:
        limits: rejection limits by terrain.
        surface: "flat", "rocky" or the terrain's own kind, by terrain.
        classifier: classifier of flat and rocky ground; None without one of that size.
    """

    limits: Mapping[str, WindowLimits]
    surface: Mapping[str, str]
    classifier: RidgeLogistic | None

    @classmethod
    def of(cls, database: TerrainDatabase, window: int) -> "_WindowRules":
        kinds = {name: terrain.kind for name, terrain in database.terrains.items()}
        surfaces = database.surfaces
        return cls(
            limits={
                name: limits_of(terrain, window)
                for name, terrain in database.terrains.items()
            },
            surface=class_labels(kinds)["surface"],
            classifier=None if surfaces is None else surfaces.models.get(window),
        )

    def verdict(self, window: _Window) -> WindowEvidence:
        scores, rows = window.scores, window.rows
        best = scores.likeliest(rows)
        strain = float(scores.strain[rows, scores.terrains.index(best)].mean())
        is_none = self.limits[best].exclude(float(window.features[ROUGHNESS]), strain)
        if self.classifier is None:
            rocky, surface = None, scores.likeliest_group(rows, self.surface)
        else:
            rocky = float(self.classifier.probabilities(window.features[None])[0])
            surface = ROCKY_GROUND if rocky > 0.5 else FLAT_GROUND
        return WindowEvidence(
            t=float(window.trial.smooth.t[window.trial.indices[rows.stop - 1]]),
            posterior=tuple(scores.posterior(rows).tolist()),
            best=NONE if is_none else best,
            surface=NONE if is_none else surface,
            rocky=rocky,
        )


def limits_of(terrain: KnownTerrain, window: int) -> WindowLimits:
    """Return the rejection limits of a terrain; infinite where not known."""
    return WindowLimits(
        roughness=terrain.roughness.get(window, -np.inf),
        strain=terrain.limits.get(window, np.inf),
    )
