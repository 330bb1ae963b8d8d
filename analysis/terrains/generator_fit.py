"""Fits the generator of a terrain: experts by EM, drift in free runs, stable by test.

Errors of the sensor bias an autoregression, and in free run that adds up while a foot
sticks: the drift is what free runs along the training trials lack of them. Of a mixture
of six experts and a single linear one that is taken which generates trials left out
better, by energy score, variogram score and events; never by the likelihood of a step.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from acquisition.errors import SettingsError
from analysis.data.prepare import PreparedTrial
from analysis.data.samples import SampleTable, TrainingSet
from analysis.data.series import Array
from analysis.gp.kernels import SquaredExponential
from analysis.gp.trial_level import TrialLevels, TrialResiduals, levels_of
from analysis.study.new_trial import LEVEL, NewTrialModel, fit_new_trial
from analysis.terrains.generator import (
    EDGES,
    FEATURES,
    GATES,
    KNOTS,
    Draws,
    Experts,
    Generator,
    Motion,
    scaled_gates,
)
from analysis.terrains.process_rows import (
    STEP,
    ProcessTrial,
    held_longer,
    process_trials,
)
from analysis.terrains.process_scores import (
    energy_score,
    events_of,
    least_drop,
    variogram_score,
)
from analysis.terrains.table import Table, rows_of

EXPERTS = 6
_POINTS = 300  # rows of the bands
_LOADS = 14  # of the bands' table
_LOAD_ENDS = (0.1, 99.9)  # % of F_n that it reaches
_SPEEDS = (
    *(-0.05, -0.02, -0.008, -0.003, 0.0, 0.003, 0.008, 0.015),
    *(0.03, 0.05, 0.08, 0.12, 0.17, 0.25),
)  # m/s
_ROUNDS = 25  # of EM
_GATE_STEPS = 15
_RIDGE = 1.0
_LEAST_SD = 0.02  # N
_CALIBRATED, _PATHS = 12, 6  # rounds of free runs, and paths along every trial
_RATES = (0.02, 0.01)  # of the drift in the first and the last rounds
_FULL_COUNT = 100.0  # samples near a knot at which its rate is half
_BELOW, _ABOVE = 0.5, 2.0  # N that F may leave the range seen
_HELD = 20.0  # s of a stick in the test of stability
_RUNS = 1000
_DRIFTED = 3.0  # N
_FEWEST = 4  # trials
_JUDGED = 8  # paths along a trial left out
_CLEARLY = 0.05  # of the logarithms of scores and events


@dataclass(frozen=True, slots=True, eq=False)
class Prepared:
    """Trials with what they are held against.

    Attributes:
        trials: of the terrain.
        bands: low, median and high of a new trial.
        levels: spread between trials and the level of each.
    """

    trials: tuple[ProcessTrial, ...]
    bands: Table
    levels: TrialLevels

    def part(self, trials: slice) -> "Prepared":
        """Return some of the trials, with the bands and the spread of all."""
        levels = replace(self.levels, levels=self.levels.levels[trials])
        return Prepared(self.trials[trials], self.bands, levels)

    def motion(self, trial: ProcessTrial) -> Motion:
        """Return the motion of a trial."""
        return Motion.of(trial.F_n, trial.v_t, self.bands)


@dataclass(frozen=True, slots=True)
class GeneratorTask:
    """Everything the generator of one terrain needs.

    Attributes:
        trials: whole trials.
        seed: of everything that is drawn.
        least: fall of force [N] that makes an event of this ground.
    """

    trials: tuple[ProcessTrial, ...]
    seed: int
    least: float

    @classmethod
    def of(
        cls, trials: Sequence[PreparedTrial], kind: str, seed: int
    ) -> "GeneratorTask":
        """Return the task of the trials of a terrain of a kind."""
        return cls(process_trials(trials), seed, least_drop(kind))


def generator_of(task: GeneratorTask) -> dict[str, Any]:
    """Return a generator as plain values, nothing where there is none.

    A pure function of the task.
    """
    try:
        generator = fit_generator(task.trials, task.seed, task.least)
    except SettingsError:
        return {}
    return {} if generator is None else generator.to_dict()


def prepare(trials: Sequence[ProcessTrial], seed: int) -> Prepared:
    """Return bands and levels of trials of one terrain, two at least."""
    bands = fit_bands(trials, seed)
    residuals = [
        (STEP * np.arange(float(t.F_t.size)), t.F_t - Motion.of(t.F_n, t.v_t, bands).m)
        for t in trials
    ]
    return Prepared(tuple(trials), bands, levels_of(TrialResiduals(residuals)))


def band_model(trials: Sequence[ProcessTrial], seed: int) -> NewTrialModel:
    """Return the model of a new trial, sticks and backward motion included."""
    tables = [SampleTable(*clipped(t), t.F_t) for t in trials]
    rows = SampleTable.joined(tables)
    count = min(_POINTS, rows.count)
    chosen = np.random.default_rng(seed).choice(rows.count, count, replace=False)
    training = TrainingSet(rows, tuple(t.count for t in tables), chosen)
    return fit_new_trial(training, SquaredExponential(), None, LEVEL)


def clipped(trial: ProcessTrial) -> tuple[Array, Array]:
    """Return F_n and v_t as the bands take them: nothing beyond their velocities."""
    return trial.F_n, np.clip(trial.v_t, _SPEEDS[0], _SPEEDS[-1])


def fit_bands(trials: Sequence[ProcessTrial], seed: int) -> Table:
    """Return low, median and high of a new trial as a table."""
    from scipy.special import ndtr

    ends = np.percentile(np.concatenate([t.F_n for t in trials]), _LOAD_ENDS)
    loads = np.linspace(float(ends[0]), float(ends[1]), _LOADS)
    grid = [x.ravel() for x in np.meshgrid(loads, _SPEEDS, indexing="ij")]
    shares = tuple(ndtr(np.array([-EDGES, 0.0, EDGES])).tolist())
    forces = band_model(trials, seed).predict(*grid).quantiles(shares)
    shaped = forces.reshape(3, _LOADS, len(_SPEEDS))
    return Table(tuple(loads.tolist()), _SPEEDS, shares, tuple(map(rows_of, shaped)))


def fit_generator(
    trials: Sequence[ProcessTrial], seed: int, least: float
) -> Generator | None:
    """Return the generator of a terrain; None where trials are few or none is stable.

    Args:
        trials: of one terrain.
        seed: of everything that is drawn.
        least: fall of force [N] that makes an event of this ground.

    Raises:
        SettingsError: forces that no model can be fitted to.
    """
    if len(trials) < _FEWEST:
        return None
    known = prepare(trials, seed)
    sizes = (EXPERTS, 1) if _is_mixture_better(known, seed, least) else (1,)
    for size in sizes:
        generator = fit_generator_of_size(known, size, seed)
        if held_drift(generator, trials, seed) <= _DRIFTED:
            return generator
    return None


def _is_mixture_better(known: Prepared, seed: int, least: float) -> bool:
    """Return whether six experts generate trials left out clearly better than one."""
    learnt, tested = (known.part(slice(k, None, 2)) for k in (0, 1))
    costs: list[float] = []
    for size in (1, EXPERTS):
        generator = fit_generator_of_size(learnt, size, seed)
        paths = [
            generator.sample(t.F_n, t.v_t, k, _JUDGED).forces
            for k, t in enumerate(tested.trials)
        ]
        costs.append(_cost(paths, tested.trials, least))
    return costs[1] < costs[0] - _CLEARLY


def _cost(
    paths: Sequence[Array], trials: Sequence[ProcessTrial], least: float
) -> float:
    """Return how unlike the trials paths are; a tenth more of a score is 0.1."""
    pairs = list(zip(paths, trials, strict=True))
    scores = [
        float(np.mean([score(x, t.F_t) for x, t in pairs]))
        for score in (energy_score, variogram_score)
    ]
    recorded = events_of([t.F_t for t in trials], trials, least)
    made = events_of(paths, trials, least)
    ratios = [
        (made.slips / len(paths[0]) + 1.0) / (recorded.slips + 1.0),
        (made.drops.size / len(paths[0]) + 1.0) / (recorded.drops.size + 1.0),
    ]
    return float(np.log(scores).sum() + np.abs(np.log(ratios)).sum())


def held_drift(
    generator: Generator, trials: Sequence[ProcessTrial], seed: int
) -> float:
    """Return how far the level goes while a foot stands still for 20 s [N].

    A thousand free runs along the trials with their longest sticks made 20 s longer:
    of the mean force in what was added, trial by trial, the largest distance from the
    median of a new trial there.
    """
    helds = [held_longer(trial, _HELD) for trial in trials]
    motions = [Motion.of(h.trial.F_n, h.trial.v_t, generator.bands) for h in helds]
    longest = max(m.m.size for m in motions)
    draws = Draws.of(seed, -(-_RUNS // len(helds)) * len(helds), longest, 2)
    runs = generator.along(motions, draws)
    return max(
        abs(float((run - motion.m)[:, held.start : held.end].mean()))
        for run, motion, held in zip(runs, motions, helds, strict=True)
    )


def fit_generator_of_size(known: Prepared, size: int, seed: int) -> Generator:
    """Return a generator with so many experts, its drift calibrated."""
    x, g, d = _steps(known)
    forces = np.concatenate(
        [t.F_t - u for t, u in zip(known.trials, known.levels.levels, strict=True)]
    )
    start = Generator(
        experts=fit_experts(x, g, d, size, seed),
        drift=np.zeros(len(KNOTS)),
        bands=known.bands,
        between=known.levels.between,
        trials=len(known.trials),
        least=float(forces.min()) - _BELOW,
        most=float(forces.max()) + _ABOVE,
    )
    return calibrated(start, known, seed)


def _steps(known: Prepared) -> tuple[Array, Array, Array]:
    """Return x, g and the increment of every step of all trials in motion."""
    parts = []
    for trial, level in zip(known.trials, known.levels.levels, strict=True):
        motion, F = known.motion(trial), trial.F_t - level
        D = np.diff(F)
        x = motion.features(F[:-1], np.concatenate([[0.0], D[:-1]]))
        is_moving = motion.fade[1:] == 1.0
        parts.append((x[is_moving], motion.gates(x)[is_moving], D[is_moving]))
    x, g, d = (np.concatenate(column) for column in zip(*parts, strict=True))
    return x, g, d


def fit_experts(x: Array, g: Array, d: Array, size: int, seed: int) -> Experts:
    """Return experts of increments by EM.

    Args:
        x: features, shape (n, 12).
        g: numbers of the gate, shape (n, 15).
        d: increments [N], shape (n,).
        size: number of experts.
        seed: of the first shares.
    """
    from scipy.optimize import minimize

    scale = g.std(axis=0)
    centre, scale = g.mean(axis=0), np.where(scale > 0.0, scale, 1.0)
    empty = Experts(
        np.zeros((size, FEATURES)),
        np.ones(size),
        np.zeros((size, GATES)),
        centre,
        scale,
    )
    G = scaled_gates(g, empty)
    ridge = 1e-4 * np.diag(np.maximum((x**2).sum(axis=0), 1e-9) / len(x))
    if size == 1:
        b = np.linalg.solve(x.T @ x + ridge, x.T @ d)
        sd = max(float((d - x @ b).std()), _LEAST_SD)
        return empty._replace(weights=b[None, :], sd=np.array([sd]))
    # rows sorted by increment start in different experts
    order = np.argsort(np.argsort(d)) * size // d.size
    shares = 0.1 / size + 0.9 * np.eye(size)[order]
    weights, sd, W = empty[:3]
    for _ in range(_ROUNDS):
        weights, sd = np.empty((size, FEATURES)), np.empty(size)
        for k in range(size):
            xw = x * shares[:, k, None]
            weights[k] = np.linalg.solve(xw.T @ x + ridge, xw.T @ d)
            square = shares[:, k] @ (d - x @ weights[k]) ** 2
            sd[k] = max(np.sqrt(square / shares[:, k].sum()), _LEAST_SD)

        def cost(w: Array, shares: Array = shares) -> tuple[float, Array]:
            logits = w.reshape(size, GATES) @ G.T
            logits -= logits.max(axis=0)
            p = np.exp(logits)
            total = p.sum(axis=0)
            value = np.log(total).sum() - (shares.T * logits).sum()
            slope = (p / total - shares.T) @ G
            ridged = slope.ravel() + _RIDGE * w
            return float(value) + 0.5 * _RIDGE * float(w @ w), ridged

        W = minimize(
            cost,
            W.ravel(),
            jac=True,
            method="L-BFGS-B",
            options={"maxiter": _GATE_STEPS},
        ).x.reshape(size, GATES)
        logits = G @ W.T
        logits -= logits.max(axis=1, keepdims=True)
        logits -= np.log(np.exp(logits).sum(axis=1, keepdims=True))
        logits += -0.5 * ((d[:, None] - x @ weights.T) / sd) ** 2 - np.log(sd)
        logits -= logits.max(axis=1, keepdims=True)
        shares = np.exp(logits)
        shares /= shares.sum(axis=1, keepdims=True)
    return Experts(weights, sd, W, centre, scale)


def calibrated(generator: Generator, known: Prepared, seed: int) -> Generator:
    """Return a generator whose free runs have the mean of the trials, by velocity."""
    motions = [known.motion(trial) for trial in known.trials]
    longest = max(motion.m.size for motion in motions)
    near = [_nearest_knots(motion.v_t) for motion in motions]
    counts = sum(share.sum(axis=0) for share in near)
    recorded = sum(
        share.T @ (trial.F_t - level)
        for share, trial, level in zip(
            near, known.trials, known.levels.levels, strict=True
        )
    )
    drift, last = np.zeros(len(KNOTS)), []
    for i in range(_CALIBRATED):
        draws = Draws.of(seed * 1000 + i, _PATHS * len(motions), longest, 2)
        runs = replace(generator, drift=drift).along(motions, draws)
        sampled = sum(
            share.T @ run.mean(axis=0) for share, run in zip(near, runs, strict=True)
        )
        gap = (recorded - sampled) / np.maximum(counts, 1.0)
        rate = _RATES[0] if i < _CALIBRATED // 2 else _RATES[1]
        drift = drift + rate * gap * counts / (counts + _FULL_COUNT)
        last.append(drift)
    return replace(generator, drift=np.mean(last[-4:], axis=0))


def _nearest_knots(v_t: Array) -> Array:
    """Return 1 at the nearest knot of the drift, 0 elsewhere, shape (T, 9)."""
    middles = 0.5 * (np.array(KNOTS[1:]) + KNOTS[:-1])
    return np.eye(len(KNOTS))[np.searchsorted(middles, v_t)]
