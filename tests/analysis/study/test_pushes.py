import numpy as np
import pytest

from analysis.data.prepare import PrepareOptions, prepare_trial
from analysis.data.series import TractionSeries
from analysis.study.pushes import (
    V_SLIP,
    FootPush,
    PushTable,
    find_pushes,
    prominent_maxima,
)
from tests.analysis.study.pushed import DT, RUNNING, one_push


def trial(F_t, v_t, F_n=None, *, is_prepared=False):
    t = DT * np.arange(len(F_t))
    jitter = 1e-6 * np.arange(len(F_t)) % 7e-6  # rows that repeat are dropped
    F_n = np.full(len(F_t), 4.0) if F_n is None else F_n
    series = TractionSeries(
        "S0", "made", t, np.asarray(v_t) + jitter, F_n, F_t, is_prepared=is_prepared
    )
    return prepare_trial(series, PrepareOptions(smoothing=1))


def test_a_push_that_runs_away_is_a_slip_at_its_peak():
    (push,) = find_pushes(trial(*one_push(9.0, 20.0)))
    assert push.peak == pytest.approx(9.0)
    assert push.F_n == pytest.approx(4.0)
    assert not push.is_held


def test_a_push_released_before_slipping_is_censored_at_its_peak():
    (push,) = find_pushes(trial(*one_push(9.0, 6.0)))
    assert push.peak == pytest.approx(6.0)
    assert push.is_held


@pytest.mark.parametrize(("share", "is_held"), [(0.99, True), (1.01, False)])
def test_motion_above_v_slip_is_a_slip(share, is_held):
    F_t, v_t = one_push(9.0, 20.0)
    (push,) = find_pushes(trial(F_t, v_t * share * V_SLIP / RUNNING))
    assert push.is_held is is_held


def test_v_slip_is_configurable():
    record = trial(*one_push(9.0, 20.0))
    assert find_pushes(record, v_slip=0.2)[0].is_held
    assert not find_pushes(record, v_slip=0.12)[0].is_held


@pytest.mark.parametrize(("height", "count"), [(1.4, 0), (1.6, 1)])
def test_a_maximum_needs_an_absolute_prominence(height, count):
    assert len(find_pushes(trial(*one_push(9.0, height)))) == count


@pytest.mark.parametrize(("depth", "count"), [(1.7, 1), (2.3, 2)])
def test_a_maximum_needs_a_relative_prominence(depth, count):
    """Two maxima of 10 N with a dip between them."""
    F_t = np.interp(np.arange(1000), [0, 300, 500, 700, 999], [0, 10, 10, 10.1, 0])
    F_t[300:701] = np.interp(np.arange(401), [0, 200, 400], [10, 10 - depth, 10.1])
    assert len(find_pushes(trial(F_t, np.full(1000, 0.01)))) == count


@pytest.mark.parametrize("seed", range(4))
def test_prominence_is_that_of_scipy(seed):
    from scipy.signal import find_peaks

    rough = np.random.default_rng(seed).normal(size=2000)
    F_t = 5.0 + np.convolve(rough.cumsum(), np.ones(9) / 9.0)
    rows, shape = find_peaks(F_t, prominence=1.5)
    expected = rows[shape["prominences"] >= 0.2 * F_t[rows]].tolist()
    assert len(expected) > 3
    assert prominent_maxima(F_t) == expected


def test_the_spike_of_resticking_is_not_a_push():
    F_t, v_t = one_push(9.0, 20.0)
    end = int(np.flatnonzero(v_t > V_SLIP)[-1])
    spike = np.interp(np.arange(len(F_t)) - end, [0, 20, 40], [0, 5.0, 0.0])
    assert len(find_pushes(trial(F_t + spike, v_t))) == 1
    late = np.interp(np.arange(len(F_t)) - end, [60, 80, 100], [0, 5.0, 0.0])
    assert [p.is_held for p in find_pushes(trial(F_t + late, v_t))] == [False, True]


def test_a_peak_before_the_last_slip_is_not_used():
    first, second = one_push(12.0, 20.0), one_push(6.0, 20.0)
    F_t = np.concatenate([first[0][:-150], second[0][300:]])
    v_t = np.concatenate([first[1][:-150], second[1][300:]])
    peaks = [push.peak for push in find_pushes(trial(F_t, v_t))]
    assert peaks == pytest.approx([12.0, 6.0], abs=0.1)


def test_prepared_rows_have_no_pushes():
    assert find_pushes(trial(*one_push(9.0, 20.0), is_prepared=True)) == ()


def test_columns_separate_trials_and_have_a_minimum_load():
    pushes = [FootPush(1.0, 5.0, 0.2, False), FootPush(2.0, 7.0, 3.5, True)]
    table = PushTable.of([(0, pushes), (1, []), (1, pushes[:1])])
    assert table.trial.tolist() == [0, 0, 2]
    assert table.terrain.tolist() == [0, 0, 1]
    assert table.load == pytest.approx([np.log(1 / 3.5), 0.0, np.log(1 / 3.5)])
    assert table.is_held.tolist() == [False, True, False]
