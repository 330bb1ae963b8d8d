"""Forces sampled along recorded paths, compared with the recorded forces.

    python -m benchmarks.path_samples TABLE|SESSION ... [--data DIR] [--count 200]

Each trial is held out in turn: the quantiles come from the model of the other trials,
the copula from the held-out normal scores of the other trials. Printed per terrain: the
energy score of half-second pieces relative to independent samples with the same
quantiles, and the correlation about 0 of normal scores 1 and 20 kept samples apart, of
recorded and sampled trials.
"""

import argparse
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import traction as tr
from analysis.data.prepare import PreparedTrial, PrepareOptions
from analysis.data.series import Array
from analysis.study.distribution import SHARES
from analysis.study.models import GP_SE_TRIAL, FittedModel
from analysis.terrains.known import KnownTerrain
from analysis.terrains.path_copula import ScoredTrial, fit_copula, lag_correlation
from analysis.terrains.table import Table, rows_of
from traction.trials import Trial

PIECE = 50  # kept samples: 0.5 s
COUNT = 200  # trials sampled along each path
NEAR, FAR = 1, 20  # lags [kept samples]
_POINTS = 32  # per axis of a table
_OPTIONS = PrepareOptions()


@dataclass(frozen=True, slots=True)
class SampledTerrain:
    """Comparison of sampled and recorded trials of a terrain.

    Attributes:
        terrain: name of the terrain.
        energy_ratio: mean energy score relative to independent samples.
        recorded: correlations of recorded normal scores at the near and far lag.
        drawn: the same of sampled trials.
    """

    terrain: str
    energy_ratio: float
    recorded: tuple[float, float]
    drawn: tuple[float, float]


def compare_samples(
    trials: Sequence[Trial], count: int = COUNT, seed: int = 1
) -> list[SampledTerrain]:
    """Return the comparison for every terrain of the trials."""
    folds = tr.compare(trials, GP_SE_TRIAL).folds
    by_terrain: dict[str, list[PreparedTrial]] = {}
    for trial in trials:
        by_terrain.setdefault(trial.terrain, []).append(trial.kept)
    return [
        _comparison(
            name,
            [
                (prepared[k], fold.models[GP_SE_TRIAL].model)
                for fold in folds
                if fold.terrain == name
                for k in fold.left_out
            ],
            count,
            np.random.default_rng(seed),
        )
        for name, prepared in by_terrain.items()
    ]


def _comparison(
    name: str,
    held_out: Sequence[tuple[PreparedTrial, FittedModel]],
    count: int,
    rng: np.random.Generator,
) -> SampledTerrain:
    slowest = _OPTIONS.slowest
    recorded = [
        ScoredTrial.of(trial, model.predict(trial.F_n, trial.v_t), slowest)
        for trial, model in held_out
    ]
    drawn: list[ScoredTrial] = []
    scores: list[tuple[float, float]] = []
    for k, (trial, model) in enumerate(held_out):
        terrain = _tabulated(name, trial, model, [*recorded[:k], *recorded[k + 1 :]])
        forces = _sampled_forces(terrain, trial, count, rng)
        marginal = terrain.predict(trial.F_n, trial.v_t)
        independent = marginal.at_scores(rng.standard_normal(forces.shape))
        for begin in range(0, trial.kept - PIECE + 1, PIECE):
            piece = slice(begin, begin + PIECE)
            truth = trial.F_t[piece]
            pair = (energy_score(f[:, piece], truth) for f in (forces, independent))
            scores.append((next(pair), next(pair)))
        prediction = model.predict(trial.F_n, trial.v_t)
        for force in forces[:20]:
            sampled = ScoredTrial.of(replace(trial, F_t=force), prediction, slowest)
            drawn.append(sampled)
    of_copula, of_independent = np.mean(scores, axis=0)
    ratio = float(of_copula / of_independent)
    return SampledTerrain(name, ratio, _correlations(recorded), _correlations(drawn))


def _correlations(trials: Sequence[ScoredTrial]) -> tuple[float, float]:
    return lag_correlation(trials, NEAR), lag_correlation(trials, FAR)


def _tabulated(
    name: str, trial: PreparedTrial, model: FittedModel, others: Sequence[ScoredTrial]
) -> KnownTerrain:
    """Return a terrain fitted without `trial`, tabulated over the trial's range."""
    F_n = np.linspace(trial.F_n.min(), trial.F_n.max(), _POINTS)
    v_t = np.geomspace(_OPTIONS.slowest, _OPTIONS.fastest, _POINTS)
    grid = (axis.ravel() for axis in np.meshgrid(F_n, v_t, indexing="ij"))
    forces = model.predict(*grid).quantiles(SHARES).reshape(-1, _POINTS, _POINTS)
    loads, speeds = (tuple(axis.tolist()) for axis in (F_n, v_t))
    table = Table(loads, speeds, SHARES, tuple(map(rows_of, forces)))
    return KnownTerrain(
        name=name,
        kind=name,
        trials=len(others),
        samples=sum(other.score.size for other in others),
        rho=0.0,
        limits={},
        tables={GP_SE_TRIAL: table},
        parameters={},
        default=GP_SE_TRIAL,
        copula=fit_copula(others),
    )


def _sampled_forces(
    terrain: KnownTerrain, trial: PreparedTrial, count: int, rng: np.random.Generator
) -> Array:
    """Return sampled forces at the kept samples of a trial [N], shape (count, n).

    They are sampled along the whole thinned path, including where the foot sticks.
    """
    first, last = trial.indices[[0, -1]]
    rows = np.arange(first, last + 1, trial.widths[1])
    smooth = trial.smooth
    dt = float(np.median(np.diff(smooth.t[rows])))
    forces = terrain.sample(smooth.F_n[rows], smooth.v_t[rows], dt, rng, count)
    return forces[:, np.isin(rows, trial.indices)]


def energy_score(draws: Array, truth: Array) -> float:
    """Return the energy score of a path [N]: Gneiting and Raftery (2007), section 4.3.

    Args:
        draws: sampled paths [N], shape (count, n).
        truth: the recorded path [N], shape (n,).
    """
    count = len(draws)
    squares = (draws**2).sum(axis=1)
    distances2 = np.add.outer(squares, squares) - 2.0 * draws @ draws.T
    spread = np.sqrt(np.maximum(distances2, 0.0)).sum() / (count * (count - 1))
    return float(np.linalg.norm(draws - truth, axis=1).mean() - 0.5 * spread)


def loaded(sources: Iterable[str], data: Path) -> list[Trial]:
    """Return the trials of sources: paths of tables, or names of sessions."""
    return [
        trial
        for source in sources
        for trial in (
            tr.load_tables(source)
            if Path(source).is_file()
            else tr.load_session(source, data)
        )
    ]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("sources", nargs="+", metavar="TABLE|SESSION")
    parser.add_argument("--data", type=Path, default=Path("data"))
    parser.add_argument("--count", type=int, default=COUNT)
    args = parser.parse_args()
    print("terrain   energy   lag 1: recorded drawn   lag 20: recorded drawn")
    for row in compare_samples(loaded(args.sources, args.data), args.count):
        print(
            f"{row.terrain:9} {row.energy_ratio:6.3f}"
            f"{row.recorded[0]:18.2f} {row.drawn[0]:5.2f}"
            f"{row.recorded[1]:19.2f} {row.drawn[1]:5.2f}"
        )


if __name__ == "__main__":
    main()
