"""Break-away models of terrains: censored fits to pushes, and resampled trials.

Terrains of stones share slope and spread, and each has its own level: they behave
alike, and ten trials of one terrain contain too few slips for a separate model. Any
other terrain has its own fit if 15 pushes slipped; otherwise its model is the traction
in slow sliding. A terrain with fewer than three trials has no model.
"""

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from analysis.data.prepare import PreparedTrial
from analysis.data.series import Array
from analysis.data.terrain_kinds import class_labels
from analysis.study.push_likelihood import CensoredLikelihood
from analysis.study.pushes import V_SLIP, FootPush, PushTable, find_pushes
from analysis.study.slip_risk import BREAK_AWAY, SLIDING, BreakAwayModel, PushLaw
from analysis.study.survival import pit_distance

ROCKY = "rocky"
LEAST_TRIALS = 3
LEAST_SLIPS, LEAST_OF_STONES = 15, 5  # for a separate fit; for each of a shared fit
_SLOW, _FAST = 0.005, 0.02  # m/s of sliding
_SEEN = 1.4  # gain in log likelihood of a significant trial effect: 5 %, at a boundary
_LEAST_VARIANCE = 1e-9  # N^2
_RANGE = (0.02, 0.98)  # quantiles between which nothing is extrapolated
_STREAM = 3_000_000  # random stream, distinct from other draws with the same seed


@dataclass(frozen=True, slots=True)
class BreakAwayOptions:
    """Options of the fit of break-away models.

    Attributes:
        v_slip: velocity threshold of a slip [m/s].
        draws: number of bootstrap draws of the trials for intervals.
        seed: seed of the draws.
    """

    v_slip: float = V_SLIP
    draws: int = 200
    seed: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class TerrainPushes:
    """Pushes of a terrain's trials, and forces in slow sliding.

    Attributes:
        name: name of the terrain.
        pushes: pushes of every trial.
        slow: F_n and F_t [N] of every trial at 0.005 to 0.02 m/s; empty = not known.
    """

    name: str
    pushes: tuple[tuple[FootPush, ...], ...]
    slow: tuple[tuple[Array, Array], ...] = ()

    @property
    def every(self) -> list[FootPush]:
        """All pushes, trial by trial."""
        return list(chain(*self.pushes))

    @property
    def slips(self) -> int:
        """Number of pushes that slipped."""
        return sum(not push.is_held for push in self.every)


@dataclass(frozen=True, slots=True)
class BreakAwayTask:
    """Input for the fit of all terrains.

    Attributes:
        terrains: pushes of every terrain.
        kinds: kind by terrain: "small" and "big" are stones.
        options: what a slip is, and how many times trials are resampled.
    """

    terrains: tuple[TerrainPushes, ...]
    kinds: Mapping[str, str]
    options: BreakAwayOptions


def plan_break_away(
    trials: Mapping[str, Sequence[PreparedTrial]],
    kinds: Mapping[str, str],
    options: BreakAwayOptions,
) -> BreakAwayTask:
    """Make the fit task for prepared trials; trials without kept samples are skipped.

    Args:
        trials: prepared trials by terrain.
        kinds: kind by terrain: "small" and "big" are stones.
        options: what a slip is, and how many times trials are resampled.
    """
    terrains: list[TerrainPushes] = []
    for name, group in trials.items():
        usable = [trial for trial in group if trial.kept]
        pushes = tuple(find_pushes(trial, options.v_slip) for trial in usable)
        slow = tuple(_slow_rows(trial) for trial in usable)
        terrains.append(TerrainPushes(name, pushes, slow))
    return BreakAwayTask(tuple(terrains), dict(kinds), options)


def _slow_rows(trial: PreparedTrial) -> tuple[Array, Array]:
    """Return F_n and F_t [N] of the kept samples in slow motion."""
    is_slow = (trial.v_t >= _SLOW) & (trial.v_t <= _FAST)
    return trial.F_n[is_slow], trial.F_t[is_slow]


def fit_break_away(
    trials: Mapping[str, Sequence[PreparedTrial]],
    kinds: Mapping[str, str],
    options: BreakAwayOptions | None = None,
) -> dict[str, BreakAwayModel]:
    """Fit the break-away model of every terrain with at least three trials.

    Pure: the same trials and options give bitwise equal results.

    Args:
        trials: prepared trials by terrain.
        kinds: kind by terrain: "small" and "big" are stones.
        options: what a slip is, and how many times trials are resampled.
    """
    return fit_planned(plan_break_away(trials, kinds, options or BreakAwayOptions()))


def fit_planned(task: BreakAwayTask) -> dict[str, BreakAwayModel]:
    """Fit the models of a task, in the order of its terrains; pure."""
    options, surface = task.options, class_labels(task.kinds)["surface"]
    candidates = [
        terrain for terrain in task.terrains if len(terrain.pushes) >= LEAST_TRIALS
    ]
    stones = [terrain for terrain in candidates if surface[terrain.name] == ROCKY]
    stones = [terrain for terrain in stones if terrain.slips >= LEAST_OF_STONES]
    others = [terrain for terrain in candidates if surface[terrain.name] != ROCKY]
    groups = [stones] if stones else []
    groups += [[terrain] for terrain in others if terrain.slips >= LEAST_SLIPS]
    fitted = {
        name: model
        for group in groups
        for name, model in _fit_group(group, options).items()
    }
    for terrain in candidates:
        if terrain.name in fitted:
            continue
        if (model := _fit_sliding(terrain, options)) is not None:
            fitted[terrain.name] = model
    names = [terrain.name for terrain in task.terrains]
    return {name: fitted[name] for name in names if name in fitted}


def _random(names: Sequence[str], options: BreakAwayOptions) -> np.random.Generator:
    key = (options.seed, zlib.crc32("+".join(names).encode()), _STREAM)
    return np.random.default_rng(key)


def _fit_group(
    group: Sequence[TerrainPushes], options: BreakAwayOptions
) -> dict[str, BreakAwayModel]:
    """Fit the models of terrains that share slope and spread."""
    table = PushTable.of([(k, p) for k, r in enumerate(group) for p in r.pushes])
    likelihood = CensoredLikelihood(table, len(group))
    best = likelihood.fit()
    rng = _random([r.name for r in group], options)
    draws = np.array(
        [
            likelihood.fit(_resampled(group, rng), best.copy())
            for _ in range(options.draws)
        ]
    ).reshape(-1, best.size)
    is_trial_seen = _trial_gain(likelihood, best) >= _SEEN
    return {
        r.name: _model(r, k, best, draws, options, is_trial_seen)
        for k, r in enumerate(group)
    }


def _resampled(group: Sequence[TerrainPushes], rng: np.random.Generator) -> Array:
    """Draw trials with replacement within each terrain; return their counts."""
    return np.concatenate(
        [
            np.bincount(rng.integers(n, size=n), minlength=n).astype(np.float64)
            for n in (len(r.pushes) for r in group)
        ]
    )


def _trial_gain(likelihood: CensoredLikelihood, best: Array) -> float:
    """Return the gain in log likelihood from the trial effect."""
    without = likelihood.fit(start=best, has_trials=False)
    gains = likelihood.by_trial(best)[0] - likelihood.by_trial(without)[0]
    return float(gains.sum())


def _model(
    recorded: TerrainPushes,
    number: int,
    best: Array,
    draws: Array,
    options: BreakAwayOptions,
    is_trial_seen: bool,
) -> BreakAwayModel:
    columns = [number, -3, -2, -1]
    laws = np.vstack([best, draws])[:, columns]
    laws[:, 2:] = np.exp(laws[:, 2:])
    pushes = recorded.every
    peaks = np.array([push.peak for push in pushes])
    loads = np.array([push.F_n for push in pushes])
    is_held = np.array([push.is_held for push in pushes])
    model = BreakAwayModel(
        kind=BREAK_AWAY,
        law=PushLaw(*laws[0].tolist()),
        draws=laws[1:],
        v_slip=options.v_slip,
        slips=recorded.slips,
        held=len(pushes) - recorded.slips,
        trials=len(recorded.pushes),
        loads=_spanned(loads),
        forces=_spanned(peaks),
        is_trial_seen=is_trial_seen,
    )
    distance = pit_distance(model.risks(peaks, loads), is_held)
    return replace(model, distance=distance)


def _spanned(values: Array) -> tuple[float, float]:
    low, high = np.quantile(values, _RANGE)
    return float(low), float(high)


def _fit_sliding(
    recorded: TerrainPushes, options: BreakAwayOptions
) -> BreakAwayModel | None:
    """Fit the law of F_t in slow sliding; None with fewer than three such trials."""
    slow = recorded.slow
    sums = np.array([_sums(F_n, F_t) for F_n, F_t in slow if F_n.size])
    if len(sums) < LEAST_TRIALS:
        return None
    law = PushLaw(*_line(sums).tolist())
    rng = _random([recorded.name], options)
    picks = rng.integers(len(sums), size=(options.draws, len(sums)))
    draws = np.array([_line(sums[pick]) for pick in picks]).reshape(-1, 4)
    return BreakAwayModel(
        kind=SLIDING,
        law=law,
        draws=draws,
        v_slip=options.v_slip,
        slips=recorded.slips,
        held=len(recorded.every) - recorded.slips,
        trials=len(sums),
        loads=_spanned(np.concatenate([F_n for F_n, _ in slow])),
        forces=_spanned(np.concatenate([F_t for _, F_t in slow])),
        is_trial_seen=law.trial_sd > 0.0,
    )


def _sums(x: Array, y: Array) -> Array:
    """Return count and means of x, y, x^2, xy, y^2 of a trial, shape (6,)."""
    return np.array(
        [x.size, x.mean(), y.mean(), (x * x).mean(), (x * y).mean(), (y * y).mean()]
    )


def _line(sums: Array) -> Array:
    """Estimate (a, b, s, su) of F_t = a + b F_n by moments, with equal trial weights.

    su^2 is the variance of the trial means in excess of that from within the trials.

    Args:
        sums: `_sums` of every trial, shape (trials, 6).
    """
    count, x, y, xx, xy, yy = sums.T
    variance = xx.mean() - x.mean() ** 2
    covariance = xy.mean() - x.mean() * y.mean()
    b = covariance / variance if variance > _LEAST_VARIANCE else 0.0
    a = y.mean() - b * x.mean()
    off = y - a - b * x
    total = yy.mean() - y.mean() ** 2 - b * (2.0 * covariance - b * variance)
    within = max(total - float((off**2).mean()), _LEAST_VARIANCE)
    between = float((off**2).sum()) / (off.size - 1) - within * float(
        (1 / count).mean()
    )
    return np.array([a, b, np.sqrt(within), np.sqrt(max(between, 0.0))])
