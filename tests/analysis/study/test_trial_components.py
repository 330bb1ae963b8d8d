"""Variance components of trials are recovered from drawn trials."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.study.models import FitOptions
from analysis.study.trial_components import (
    ComponentsTask,
    TimedRows,
    TrialComponents,
    fit_components,
)
from analysis.tustin.identifiability import Interval

STEP, SAMPLES = 0.01, 800  # s, kept samples of a trial


def drawn(count, between, within, tau, noise, seed=0, draws=100):
    """Return trials with a level, an Ornstein-Uhlenbeck residual and noise."""
    from scipy.signal import lfilter

    rng = np.random.default_rng(seed)
    rho = np.exp(-STEP / tau)
    trials = []
    for _ in range(count):
        wander = np.cumsum(rng.normal(size=(SAMPLES, 2)), axis=0) / 20.0
        F_n = 4.0 + 2.0 * np.sin(wander[:, 0])
        v_t = 0.06 + 0.05 * np.sin(wander[:, 1])
        start = rng.normal(0.0, within)
        along, _ = lfilter(
            [within * np.sqrt(1 - rho**2)],
            [1.0, -rho],
            rng.normal(size=SAMPLES),
            zi=[rho * start],
        )
        F_t = 0.6 * F_n + rng.normal(0, between) + along + rng.normal(0, noise, SAMPLES)
        trials.append(TimedRows(F_n, v_t, F_t, STEP * np.arange(SAMPLES)))
    return ComponentsTask("S0", tuple(trials), FitOptions(draws=draws))


@pytest.fixture(scope="module")
def known():
    return fit_components(drawn(20, between=1.5, within=1.0, tau=0.3, noise=0.2))


def test_the_true_variance_components_are_recovered(known):
    # twenty trials show a spread between them to 16 %
    assert known.between == pytest.approx(1.5, rel=0.5)
    assert known.within == pytest.approx(1.0, rel=0.3)
    assert known.tau == pytest.approx(0.3, rel=0.5)
    assert known.is_distinguishable
    assert known.trials == 20
    assert known.seconds == pytest.approx(8.0)


@pytest.mark.parametrize("name", ["between", "within", "tau"])
def test_every_component_has_an_interval_around_it(known, name):
    interval = known.intervals[name]
    assert interval.lower < getattr(known, name) < interval.upper
    assert interval.upper / interval.lower > 1.1


def test_equal_trials_have_no_spread():
    same = fit_components(drawn(8, 0.0, 1.0, 0.3, 0.2, seed=3, draws=0))
    assert same.intervals == {}
    assert not same.is_distinguishable
    assert same.gain < 1.4


def test_the_same_task_gives_the_same_components():
    first, again = (fit_components(drawn(4, 1.5, 1.0, 0.3, 0.2, draws=5)) for _ in "ab")
    assert again == first


def test_two_trials_give_no_spread():
    assert fit_components(drawn(2, 1.0, 1.0, 0.3, 0.2)) is None


def test_the_level_error_falls_with_the_root_of_the_trials():
    ends = Interval(0.0, 1.0)
    components = TrialComponents(
        10, 8.0, between=0.6, within=1.0, tau=0.5, measurement=0.1,
        intervals={"between": ends}, gain=3.0,
    )  # fmt: skip
    assert components.independent == pytest.approx(8.0)
    assert components.level_sd(1) == pytest.approx(np.sqrt(0.36 + 1.0 / 8.0))
    assert components.level_sd(9) == pytest.approx(components.level_sd(1) / 3.0)


def test_residuals_are_of_held_out_rows():
    seen = []
    for seed in range(12):
        task = drawn(3, 0.0, 0.0, 0.1, 0.5, seed, draws=0)
        short = tuple(
            TimedRows(t.F_n[::40], t.v_t[::40], t.F_t[::40], t.t[::40])
            for t in task.trials
        )
        found = fit_components(replace(task, trials=short))
        seen.append(found.within**2 + found.measurement**2)
    # 60 rows: a function fitted to all of them absorbs a part of their noise, 0.490
    assert np.sqrt(np.mean(seen)) == pytest.approx(0.5, rel=0.015)
