"""Made pushes: a foot that loads, creeps and slips on stones, or glides on a plate."""

from functools import lru_cache

import numpy as np

from analysis.data.series import TractionSeries
from analysis.foresight.judged import JudgedTask, WatchedSource
from analysis.foresight.model import RigIdentity
from analysis.foresight.training import fit_foresight
from analysis.foresight.watching import watch_series

RATE, SECONDS = 500, 15.0
RIG = RigIdentity("true", "true", "0.3", "0.45")
OTHER_RIG = RigIdentity("false", "true", "0.3", "0.45")
STONES, PLATE = "S10", "TF"
_LOADING, _SLIP, _LEFT = 12.0, 0.16, 0.35  # N/s, s, share of the force left


def push_on_stones(seed):
    """Return v_t, F_t, F_n of a push; it creeps before it slips."""
    random = np.random.default_rng(seed)
    v_t, F_t = [], []
    force, capacity, left = 2.0, 8.0, 0
    length = round(_SLIP * RATE)
    for _ in range(round(SECONDS * RATE)):
        if left:
            v_t.append(0.35 * np.sin(np.pi * (1 - left / length)))
            force += (_LEFT * capacity - force) / (0.3 * length)
            left -= 1
            if not left:
                capacity = 8.0 * np.exp(0.25 * random.normal())
        else:
            force += _LOADING / RATE
            v_t.append(0.02 * np.exp(6.0 * (force / capacity - 1.0)))
            if force >= capacity:
                left = length
        F_t.append(force)
    return _with_noise(random, v_t, F_t)


def glide_on_plate(seed):
    """Return v_t, F_t, F_n of a steady push over a plate."""
    random = np.random.default_rng(seed)
    t = np.arange(round(SECONDS * RATE)) / RATE
    v_t = 0.05 + 0.02 * np.sin(2.0 * np.pi * 0.7 * t + seed)
    return _with_noise(random, v_t, 3.0 + 8.0 * v_t)


def _with_noise(random, v_t, F_t):
    count = len(v_t)
    F_n = 4.0 + 0.5 * np.sin(np.arange(count) / 700.0) + 0.1 * random.normal(size=count)
    F_t = np.array(F_t) + 0.2 * random.normal(size=count)
    return np.array(v_t), F_t, F_n


@lru_cache
def trial(terrain, seed):
    """Return one watched push."""
    is_plate = terrain == PLATE
    v_t, F_t, F_n = glide_on_plate(seed) if is_plate else push_on_stones(seed)
    t = np.arange(v_t.size) / RATE
    series = TractionSeries(terrain, f"{terrain}/{seed}", t, v_t, F_n, F_t)
    return watch_series(series, "flat" if is_plate else "rocky", RIG)


@lru_cache
def trials(first, count):
    """Return watched pushes on both grounds."""
    return tuple(
        trial(terrain, seed)
        for terrain in (STONES, PLATE)
        for seed in range(first, first + count)
    )


@lru_cache
def model():
    """Return what five pushes on each ground teach."""
    return fit_foresight(trials(0, 5))


def judged_task(watched):
    """Return the task of watched pushes, their samples taken to have one digest."""
    sources = [
        WatchedSource(t.terrain, t.name, t.surface, t.rig, t.seed, "0" * 64)
        for t in watched
    ]
    return JudgedTask(tuple(sources), {})
