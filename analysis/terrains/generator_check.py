"""A generator against trials that it was not fitted to."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from acquisition.errors import SettingsError
from analysis.data.prepare import PreparedTrial
from analysis.data.series import Array
from analysis.terrains.generator import EDGES, Draws, Generator
from analysis.terrains.generator_fit import GeneratorTask, fit_generator
from analysis.terrains.process_rows import ProcessTrial
from analysis.terrains.process_scores import (
    energy_score,
    events_of,
    ks_distance,
    variogram_score,
)

SHOWN = 5  # paths beside a trial
_EVERY = 3  # one trial of so many is left out
_PATHS = 16
_FEWEST = 6  # trials, of which four are fitted to


class SampledTrials(NamedTuple):
    """How like trials left out the samples along them are.

    Attributes:
        experts: of the generator.
        fitted: trials that it was fitted to.
        left_out: trials that it was not.
        energy: energy score over that of independent rows of the same bands.
        variogram: variogram score over the same.
        slips: per metre, sampled and recorded [1/m].
        drops: per metre, sampled and recorded [1/m].
        drop_distance: between the distributions of drops.
        way_distance: between those of the way from one to the next.
        recorded: F_t [N] of the first trial left out, shape (T,).
        paths: F_t [N] sampled along it, shape (5, T).
    """

    experts: int
    fitted: int
    left_out: int
    energy: float
    variogram: float
    slips: tuple[float, float]
    drops: tuple[float, float]
    drop_distance: float
    way_distance: float
    recorded: Array
    paths: Array


SAMPLED_TYPES: Mapping[str, type] = {"SampledTrials": SampledTrials}


def generator_tasks(
    trials: Mapping[str, Sequence[PreparedTrial]], kinds: Mapping[str, str], seed: int
) -> dict[str, GeneratorTask]:
    """Return the task of every terrain with trials enough to leave some out.

    Args:
        trials: prepared trials by terrain.
        kinds: kind by terrain.
        seed: of the study.
    """
    tasks = {
        name: GeneratorTask.of(group, kinds[name], seed)
        for name, group in trials.items()
    }
    return {name: task for name, task in tasks.items() if len(task.trials) >= _FEWEST}


def judge_generator(task: GeneratorTask) -> SampledTrials | None:
    """Return how a generator of two trials in three samples the others.

    A pure function of the task; None where there is no generator.
    """
    tested = task.trials[::_EVERY]
    trials = [t for k, t in enumerate(task.trials) if k % _EVERY]
    try:
        generator = fit_generator(trials, task.seed, task.least)
    except SettingsError:
        return None
    if generator is None:
        return None
    longest = max(t.F_t.size for t in tested)
    draws = Draws.of(task.seed, _PATHS * len(tested), longest, generator.trials)
    paths = generator.run([(t.F_n, t.v_t) for t in tested], draws)
    rows = [_rows(generator, trial, task.seed) for trial in tested]
    ratios = [
        np.mean([score(x, t.F_t) for x, t in zip(paths, tested, strict=True)])
        / np.mean([score(x, t.F_t) for x, t in zip(rows, tested, strict=True)])
        for score in (energy_score, variogram_score)
    ]
    made = events_of(paths, tested, task.least)
    true = events_of([t.F_t for t in tested], tested, task.least)
    return SampledTrials(
        experts=generator.size,
        fitted=len(trials),
        left_out=len(tested),
        energy=float(ratios[0]),
        variogram=float(ratios[1]),
        slips=(made.slips_per_metre, true.slips_per_metre),
        drops=(made.drops_per_metre, true.drops_per_metre),
        drop_distance=ks_distance(made.drops, true.drops),
        way_distance=ks_distance(made.ways, true.ways),
        recorded=tested[0].F_t,
        paths=paths[0][:SHOWN],
    )


def _rows(generator: Generator, trial: ProcessTrial, seed: int) -> Array:
    """Return independent rows of a generator's bands, shape (16, T)."""
    low, m, high = generator.bands.over(trial.F_n, trial.v_t)
    z = np.random.default_rng(seed).standard_normal((_PATHS, m.size)) / EDGES
    return m + np.where(z < 0.0, z * (m - low), z * (high - m))
