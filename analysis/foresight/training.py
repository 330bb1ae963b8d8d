"""From watched trials to what foresight knows; nothing is judged by what it taught.

The threshold of alarms is set on trials that the fit of their fold has not seen.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

from analysis.data.series import Array
from analysis.foresight.ground import (
    JUDGED,
    SHARES,
    GroundLaw,
    GroundModel,
    log_speed,
)
from analysis.foresight.ground_window import WINDOWS
from analysis.foresight.logistic import (
    RidgeLogistic,
    all_pairs,
    fit_balanced,
    fit_logistic,
)
from analysis.foresight.model import ForesightModel, Provenance, SlipModel
from analysis.foresight.watching import FLAT_SURFACE, ROCKY_SURFACE, WatchedTrial

LEAST_SLIPS = 30  # that a probability of slips is learnt from
LEAST_TICKS = 200  # of sliding that a terrain's law needs
ALARM_SHARE = 0.08  # of the at-risk time outside the 0.2 s before slips, in training
FOLDS = 5
_MULTIPLIED = (0, 1, 2, 5, 9, 10, 12, 17, 18, 22)  # features whose products count
_EVERY_TICK = 2  # ticks are correlated: every second one is fitted to
_NEW = 0.1  # share of an overlapping window that the one before did not have
_LOG_SPREAD = 0.635  # ln s less E ln|e| of a normal variable
_BEYOND = 1.25  # of the largest load and traction that were learnt from
_LEAST_RESIDUAL = 0.05  # N, below which logarithms of residuals end


def fit_foresight(trials: Sequence[WatchedTrial]) -> ForesightModel | None:
    """Return what trials teach; None where no terrain has slid for 2 s.

    A pure function: the same trials give the same bits on one machine.
    """
    ground = fit_ground(trials)
    if not ground.laws:
        return None
    provenance = Provenance(
        rigs=tuple(dict.fromkeys(trial.rig for trial in trials)),
        trials=tuple(trial.name for trial in trials),
        seeds=tuple(dict.fromkeys(t.seed for t in trials if t.seed)),
    )
    return ForesightModel(fit_slip(trials), ground, provenance)


def fit_ground(trials: Sequence[WatchedTrial]) -> GroundModel:
    """Return what trials teach of their grounds; no law where none slid for 2 s."""
    with threadpool_limits(1):  # threads that share the work change the last bits
        laws = fit_laws(trials)
        return GroundModel(laws, _fit_surfaces(trials) if laws else ())


def fit_slip(trials: Sequence[WatchedTrial]) -> SlipModel | None:
    """Return the probability of slips; None below 30 slips.

    The threshold leaves 8 % of the at-risk time outside the 0.2 s before slips in
    alarm, over the terrains that slip, each trial judged by a fit of other folds.
    """
    with threadpool_limits(1):  # as above
        return _fit_slip(trials)


def _fit_slip(trials: Sequence[WatchedTrial]) -> SlipModel | None:
    slips = sum(trial.onsets.size for trial in trials)
    if slips < LEAST_SLIPS:
        return None
    every = _regression(trials)
    slipping = {t.terrain for t in trials if t.onsets.size}
    needless: list[Array] = []
    for fold in range(FOLDS):
        rest = [t for k, t in enumerate(trials) if k % FOLDS != fold]
        if not sum(trial.onsets.size for trial in rest):
            continue
        regression = _regression(rest)
        for trial in trials[fold::FOLDS]:
            if trial.terrain in slipping:
                rows = trial.is_at_risk & ~trial.is_before_slip
                needless.append(regression.probabilities(trial.features[rows]))
    judged = np.concatenate(needless)
    threshold = float(np.quantile(judged, 1.0 - ALARM_SHARE))
    return SlipModel(threshold, int(slips), _reach(trials), every)


def _reach(trials: Sequence[WatchedTrial]) -> tuple[float, float]:
    """Return F_n and F_t [N] somewhat beyond all but a thousandth of the ticks."""
    motion = np.concatenate([trial.motion[trial.is_at_risk] for trial in trials])
    F_t, F_n = (_BEYOND * float(np.quantile(motion[:, k], 0.999)) for k in (1, 2))
    return F_n, F_t


def _regression(trials: Sequence[WatchedTrial]) -> RidgeLogistic:
    features: list[Array] = []
    truth: list[np.ndarray] = []
    for trial in trials:
        rows = np.flatnonzero(trial.is_at_risk)[::_EVERY_TICK]
        features.append(trial.features[rows])
        truth.append(trial.is_before_slip[rows])
    X, y = np.concatenate(features), np.concatenate(truth)
    return fit_logistic(X, y, np.ones(y.size), all_pairs(_MULTIPLIED))


def fit_laws(trials: Sequence[WatchedTrial]) -> tuple[GroundLaw, ...]:
    """Return the law of every terrain that has slid for 2 s."""
    laws: list[GroundLaw] = []
    for name in dict.fromkeys(trial.terrain for trial in trials):
        own = [trial for trial in trials if trial.terrain == name]
        if sum(len(trial.sliding) for trial in own) >= LEAST_TICKS:
            laws.append(_judged(own))
    return tuple(laws)


def _judged(own: Sequence[WatchedTrial]) -> GroundLaw:
    """Return the law of a terrain, its windows judged by laws of its other trials."""
    densities: list[Array] = []
    for trial in own:
        others = [other for other in own if other is not trial]
        is_enough = sum(len(other.sliding) for other in others) >= LEAST_TICKS
        law = _law(others if is_enough else own)
        densities.append(_window_densities(law, trial))
    judged = np.concatenate(densities)
    limits = np.quantile(judged, SHARES) if judged.size else np.zeros(len(SHARES))
    return replace(_law(own), densities=tuple(limits.tolist()))


def _law(own: Sequence[WatchedTrial]) -> GroundLaw:
    motion = np.concatenate([trial.motion[trial.sliding] for trial in own])
    F_n, u = motion[:, 2], np.log(motion[:, 0])
    low, high = (float(v) for v in np.quantile(F_n, (0.01, 0.99)))
    load = np.clip(F_n, low, high)
    design = np.column_stack([np.ones(load.size), load, u, load**2, load * u, u**2])
    mean = _least_squares(design, motion[:, 1])
    spread = np.log(np.abs(motion[:, 1] - design @ mean) + _LEAST_RESIDUAL)
    log_sd = _least_squares(design[:, :3], spread)
    log_sd[0] += _LOG_SPREAD
    return GroundLaw(
        name=own[0].terrain,
        surface=own[0].surface,
        mean=tuple(mean.tolist()),
        log_sd=tuple(log_sd.tolist()),
        loads=(low, high),
        densities=(0.0,) * len(SHARES),
    )


def _least_squares(design: Array, values: Array) -> Array:
    scale = np.abs(design).max(axis=0)
    X = design / scale
    ridge = 1e-6 * len(values) * np.eye(X.shape[1])
    return np.linalg.solve(X.T @ X + ridge, X.T @ values) / scale


def _window_densities(law: GroundLaw, trial: WatchedTrial) -> Array:
    """Return the mean log density of every window of 0.5 s of sliding."""
    own = [
        law.log_density(F_t, F_n, log_speed(v))
        for v, F_t, F_n in trial.motion[trial.sliding].tolist()
    ]
    if len(own) < JUDGED:
        return np.zeros(0)
    return np.convolve(own, np.full(JUDGED, 1.0 / JUDGED), "valid")


def _fit_surfaces(
    trials: Sequence[WatchedTrial],
) -> tuple[tuple[int, RidgeLogistic], ...]:
    """Return the regression of rocky ground by window; none with one surface only."""
    known = [t for t in trials if t.surface in (FLAT_SURFACE, ROCKY_SURFACE)]
    fitted: list[tuple[int, RidgeLogistic]] = []
    for size in WINDOWS:
        parts = [(t.windows[size], t.surface == ROCKY_SURFACE) for t in known]
        regression = fit_balanced(parts, _NEW)
        if regression is not None:
            fitted.append((size, regression))
    return tuple(fitted)
