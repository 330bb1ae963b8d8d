"""Trials made of pushes of known strength: a ramp, then a slip or a release."""

from dataclasses import dataclass

import numpy as np

from analysis.data.prepare import PrepareOptions, prepare_trial
from analysis.data.series import TractionSeries

DT = 0.002
REST, RAMP, SLIP, FADE = 100, 350, 60, 150  # rows
RUNNING = 0.15  # m/s while it slips


@dataclass(frozen=True)
class Law:
    """log P = level + slope log(F_n/3.5) + spread * (smallest extreme value)."""

    level: float = 2.2
    slope: float = 0.5
    spread: float = 0.3

    def strength(self, rng, F_n):
        residual = np.log(-np.log(rng.uniform(size=np.shape(F_n))))
        return np.exp(
            self.level + self.slope * np.log(F_n / 3.5) + self.spread * residual
        )


def one_push(strength, intended):
    """Return F_t and v_t of a push to `intended` [N] on ground of that strength."""
    peak = min(strength, intended)
    ramp = np.linspace(0.0, peak, RAMP)
    crawl = np.full(RAMP, 0.01)
    if intended < strength:
        F_t = [np.zeros(REST), ramp, np.linspace(peak, 0.0, FADE)]
        v_t = [np.zeros(REST), crawl, np.zeros(FADE)]
    else:
        F_t = [np.zeros(REST), ramp, np.zeros(SLIP + FADE)]
        v_t = [np.zeros(REST), crawl, np.full(SLIP, RUNNING), np.zeros(FADE)]
    return np.concatenate(F_t), np.concatenate(v_t)


def pushed_trial(rng, *, terrain="S0", law=Law(), pushes=8, name="made"):
    """Return a prepared trial of `pushes` pushes at loads of 1.5 to 8 N."""
    F_n = rng.uniform(1.5, 8.0, pushes)
    strengths = law.strength(rng, F_n)
    intended = rng.uniform(3.0, 30.0, pushes)
    parts = [one_push(s, i) for s, i in zip(strengths, intended, strict=True)]
    load = np.concatenate(
        [np.full(F_t.size, f) for (F_t, _), f in zip(parts, F_n, strict=True)]
    )
    F_t = np.concatenate([part[0] for part in parts])
    v_t = np.concatenate([part[1] for part in parts])
    t = DT * np.arange(F_t.size)
    # a little noise: rows that repeat are dropped
    F_t = F_t + rng.normal(0.0, 0.02, t.size)
    series = TractionSeries(terrain, name, t, v_t, load, F_t)
    return prepare_trial(series, PrepareOptions())


def pushed_trials(seed, count, **choices):
    rng = np.random.default_rng(seed)
    return [pushed_trial(rng, name=f"made-{k}", **choices) for k in range(count)]
