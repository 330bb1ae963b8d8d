"""Verdicts on windows of a trial: the likeliest terrain, flat or rocky, or none known.

A window is of none of the known terrains where it strains the likeliest one's model
more than nearly all of its own windows do, or is smoother than nearly all of them: a
plate fits into the wide bands of stones and shows itself only by what it lacks. Among
stones the likeliest terrain is a name for a family: they are alike, and `surface`, flat
or rocky, is what can be told.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from analysis.data.prepare import PreparedTrial
from analysis.data.series import Array
from analysis.data.terrain_kinds import groups_of
from analysis.terrains.classifier import FLAT_GROUND, ROCKY_GROUND
from analysis.terrains.known import KnownTerrain, TerrainDatabase
from analysis.terrains.logistic import RidgeLogistic
from analysis.terrains.recognition import Expert, TerrainScores, score_trial
from analysis.terrains.windows import RESID, window_features

NONE = "none"  # of the known terrains


@dataclass(frozen=True, slots=True)
class WindowEvidence:
    """The evidence of one window.

    Attributes:
        t: time of its last sample [s].
        posterior: probability of each terrain, in the database's order.
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
    """The terrain that a trial is attributed to.

    Attributes:
        terrains: names, in the database's order.
        moments: evidence window by window.
        posterior: probability of each terrain after the whole trial.
        best: the verdict on the whole trial: a terrain or "none".
        least_error: the paper's rule: the terrain with the smallest error.
        surface: the answer of most windows: "flat", "rocky", "none".
    """

    terrains: tuple[str, ...]
    moments: tuple[WindowEvidence, ...]
    posterior: tuple[float, ...]
    best: str
    least_error: str
    surface: str


@dataclass(frozen=True, slots=True)
class WindowLimits:
    """What hardly any of a terrain's own windows of one size goes beyond.

    Attributes:
        roughness: smallest log sd of F_t about a line in F_n [nat].
        strain: largest mean squared error over the predicted variance.
    """

    roughness: float = -np.inf
    strain: float = np.inf

    def exclude(self, roughness: float, strain: float) -> bool:
        """Whether a window is too smooth, or strains the model too much."""
        return roughness < self.roughness or strain > self.strain


def recognise(
    trial: PreparedTrial, database: TerrainDatabase, window: int = 100
) -> Recognition | None:
    """Return which terrain of `database` a trial is from; None without a window.

    The verdict is "none" when most windows are of none of the known terrains.

    Args:
        trial: its kept samples count.
        database: the known terrains.
        window: kept samples per moment: 50, 100 or 200.
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
    known = _Known.of(database, window)
    moments = [
        known.moment(_Judged(trial, scores, rows, row))
        for rows, row in zip(windows, window_features(trial, windows), strict=True)
    ]
    whole = slice(0, len(scores.log_density))
    strange = sum(moment.best == NONE for moment in moments)
    is_none = strange > 0.5 * len(moments)
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
class _Judged:
    """A window of a trial: its kept samples and its features."""

    trial: PreparedTrial
    scores: TerrainScores
    rows: slice
    features: Array


@dataclass(frozen=True, slots=True)
class _Known:
    """What is known for windows of one size.

    Attributes:
        limits: of every terrain's windows.
        surface: "flat", "rocky" or its own kind, by terrain.
        classifier: of flat and rocky ground; None where there is none of that size.
    """

    limits: Mapping[str, WindowLimits]
    surface: Mapping[str, str]
    classifier: RidgeLogistic | None

    @classmethod
    def of(cls, database: TerrainDatabase, window: int) -> "_Known":
        kinds = {name: terrain.kind for name, terrain in database.terrains.items()}
        surfaces = database.surfaces
        return cls(
            limits={
                name: limits_of(terrain, window)
                for name, terrain in database.terrains.items()
            },
            surface=groups_of(kinds)["surface"],
            classifier=None if surfaces is None else surfaces.models.get(window),
        )

    def moment(self, judged: _Judged) -> WindowEvidence:
        scores, rows = judged.scores, judged.rows
        best = scores.likeliest(rows)
        strain = float(scores.strain[rows, scores.terrains.index(best)].mean())
        is_none = self.limits[best].exclude(float(judged.features[RESID]), strain)
        if self.classifier is None:
            rocky, surface = None, scores.likeliest_group(rows, self.surface)
        else:
            rocky = float(self.classifier.probabilities(judged.features[None])[0])
            surface = ROCKY_GROUND if rocky > 0.5 else FLAT_GROUND
        return WindowEvidence(
            t=float(judged.trial.smooth.t[judged.trial.indices[rows.stop - 1]]),
            posterior=tuple(scores.posterior(rows).tolist()),
            best=NONE if is_none else best,
            surface=NONE if is_none else surface,
            rocky=rocky,
        )


def limits_of(terrain: KnownTerrain, window: int) -> WindowLimits:
    """Return the limits of a known terrain's windows; none where they are not known."""
    return WindowLimits(
        roughness=terrain.roughness.get(window, -np.inf),
        strain=terrain.limits.get(window, np.inf),
    )
