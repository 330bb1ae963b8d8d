"""One trial against a terrain database: probabilities over time, and a verdict."""

from dataclasses import dataclass

from analysis.data import PreparedTrial
from analysis.terrains.database import KnownTerrain, TerrainDatabase
from analysis.terrains.scores import Expert, TerrainScores, score_trial

NONE = "none"  # of the known terrains


@dataclass(frozen=True, slots=True)
class WindowEvidence:
    """The evidence of one window.

    Attributes:
        t: time of its last sample [s].
        posterior: probability of each terrain, in the database's order.
        best: the likeliest terrain, or "none".
    """

    t: float
    posterior: tuple[float, ...]
    best: str


@dataclass(frozen=True, slots=True)
class Recognition:
    """The terrain that a trial is attributed to.

    Attributes:
        terrains: names, in the database's order.
        moments: evidence window by window.
        posterior: probability of each terrain after the whole trial.
        best: the verdict on the whole trial: a terrain or "none".
        least_error: the paper's rule: the terrain with the smallest error.
    """

    terrains: tuple[str, ...]
    moments: tuple[WindowEvidence, ...]
    posterior: tuple[float, ...]
    best: str
    least_error: str


def recognise(
    trial: PreparedTrial, database: TerrainDatabase, window: int = 100
) -> Recognition | None:
    """Return which terrain of `database` a trial is from; None without a window.

    The verdict is "none" when most windows strain even the likeliest terrain's model
    more than 99 % of its own windows do.

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
    known = list(database.terrains.values())
    moments = [
        WindowEvidence(
            t=float(trial.smooth.t[trial.indices[rows.stop - 1]]),
            posterior=tuple(scores.posterior(rows).tolist()),
            best=_best(scores, rows, known, window),
        )
        for rows in windows
    ]
    whole = slice(0, len(scores.log_density))
    strange = sum(moment.best == NONE for moment in moments)
    is_none = strange > 0.5 * len(moments)
    return Recognition(
        terrains=scores.terrains,
        moments=tuple(moments),
        posterior=tuple(scores.posterior(whole).tolist()),
        best=NONE if is_none else scores.likeliest(whole),
        least_error=scores.least_error(whole),
    )


def _best(
    scores: TerrainScores, rows: slice, known: list[KnownTerrain], window: int
) -> str:
    best = scores.likeliest(rows)
    place = scores.terrains.index(best)
    limit = known[place].limits.get(window)
    strain = float(scores.strain[rows, place].mean())
    return NONE if limit is not None and strain > limit else best
