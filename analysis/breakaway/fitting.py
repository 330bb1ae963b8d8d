"""From trials to break-away models: pushes, a family, a fit, resampled trials.

Stones share slope and spread, every terrain has its level: they give alike, and ten
trials of one terrain hold too few slips for a model of its own. Any other terrain has
its own fit where 15 pushes slipped; where fewer did, the answer is what the foot meets
in slow motion. A terrain of fewer than three trials has no answer.
"""

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from analysis.breakaway.censored import CensoredLikelihood, Family
from analysis.breakaway.model import BREAK_AWAY, SLIDING, BreakAwayModel, PushLaw
from analysis.breakaway.pushes import PushTable
from analysis.breakaway.recorded import (
    BreakAwayOptions,
    BreakAwayTask,
    TerrainPushes,
    plan_break_away,
)
from analysis.breakaway.survival import pit_distance
from analysis.data.prepare import PreparedTrial
from analysis.data.series import Array
from analysis.data.terrain_kinds import groups_of

ROCKY = "rocky"
LEAST_TRIALS = 3
LEAST_SLIPS, LEAST_OF_STONES = 15, 5  # alone, and of each that shares its spread
_SEEN = 1.4  # gain in log likelihood of a trial effect: 5 % on the boundary
_LEAST_VARIANCE = 1e-9  # N^2
_RANGE = (0.02, 0.98)  # quantiles between which nothing is extrapolated
_STREAM = 3_000_000  # apart from other draws of the same seed


def fit_break_away(
    trials: Mapping[str, Sequence[PreparedTrial]],
    kinds: Mapping[str, str],
    options: BreakAwayOptions | None = None,
) -> dict[str, BreakAwayModel]:
    """Return the break-away model of every terrain that has three trials.

    A pure function: the same trials and options give the same bits.

    Args:
        trials: prepared trials by terrain.
        kinds: kind by terrain: "small" and "big" are stones.
        options: what a slip is, and how many times trials are resampled.
    """
    return fit_planned(plan_break_away(trials, kinds, options or BreakAwayOptions()))


def fit_planned(task: BreakAwayTask) -> dict[str, BreakAwayModel]:
    """Return the models of a task, in the order of its terrains; a pure function."""
    options, surface = task.options, groups_of(task.kinds)["surface"]
    known = [
        terrain for terrain in task.terrains if len(terrain.pushes) >= LEAST_TRIALS
    ]
    stones = [terrain for terrain in known if surface[terrain.name] == ROCKY]
    stones = [terrain for terrain in stones if terrain.slips >= LEAST_OF_STONES]
    others = [terrain for terrain in known if surface[terrain.name] != ROCKY]
    groups = [stones] if stones else []
    groups += [[terrain] for terrain in others if terrain.slips >= LEAST_SLIPS]
    fitted = {
        name: model
        for group in groups
        for name, model in _fit_group(group, options).items()
    }
    for terrain in known:
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
    """Return the models of terrains that share slope and spread."""
    table = PushTable.of([(k, p) for k, r in enumerate(group) for p in r.pushes])
    family = _family(group, table)
    likelihood = CensoredLikelihood(table, family, len(group))
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
        r.name: _model(r, k, family, best, draws, options, is_trial_seen)
        for k, r in enumerate(group)
    }


def _resampled(group: Sequence[TerrainPushes], rng: np.random.Generator) -> Array:
    """Return how often every trial is drawn; each terrain keeps its number of them."""
    return np.concatenate(
        [
            np.bincount(rng.integers(n, size=n), minlength=n).astype(np.float64)
            for n in (len(r.pushes) for r in group)
        ]
    )


def _family(group: Sequence[TerrainPushes], table: PushTable) -> Family:
    """Return the family that scores better on trials that its fit has not seen.

    A fold leaves out the trial of one number of every terrain.
    """
    number = np.concatenate([np.arange(len(r.pushes)) for r in group])[table.trial]
    scores = {
        family: _inner_score(table, family, len(group), number) for family in Family
    }
    return max(scores, key=lambda family: scores[family])


def _inner_score(
    table: PushTable, family: Family, levels: int, number: np.ndarray
) -> float:
    whole = CensoredLikelihood(table, family, levels).fit()
    total = 0.0
    for k in np.unique(number):
        rest, left = table.take(number != k), table.take(number == k)
        if not rest.count:
            continue
        fitted = CensoredLikelihood(rest, family, levels).fit(start=whole)
        total += float(
            CensoredLikelihood(left, family, levels).log_scores(fitted).sum()
        )
    return total


def _trial_gain(likelihood: CensoredLikelihood, best: Array) -> float:
    """Return what the effect of the trial gains in log likelihood."""
    without = likelihood.fit(start=best, has_trials=False)
    gains = likelihood.by_trial(best)[0] - likelihood.by_trial(without)[0]
    return float(gains.sum())


def _model(
    recorded: TerrainPushes,
    number: int,
    family: Family,
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
        family=family,
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
    """Return the law of F_t in slow motion; None with fewer than three such trials."""
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
        family=Family.LOGNORMAL,
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
    """Return count, and mean x, y, x^2, xy, y^2 of a trial, shape (6,)."""
    return np.array(
        [x.size, x.mean(), y.mean(), (x * x).mean(), (x * y).mean(), (y * y).mean()]
    )


def _line(sums: Array) -> Array:
    """Return (a, b, s, su) of F_t = a + b F_n by moments, every trial counting alike.

    su^2 is what the means of the trials scatter beyond the scatter within them.

    Args:
        sums: of every trial, shape (trials, 6).
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
