import numpy as np
import pytest

from analysis.foresight.signals import FEATURES, LAGS, PERIOD, Signals


def fed(x, F_t=None, F_n=None):
    """Return the filters after samples, and v_t at each."""
    F_t = np.full(len(x), 3.0) if F_t is None else F_t
    F_n = np.full(len(x), 4.0) if F_n is None else F_n
    signals, v_t = Signals(x[0], F_t[0], F_n[0]), [0.0]
    for row in zip(x[1:], F_t[1:], F_n[1:], strict=True):
        signals.push(*map(float, row))
        v_t.append(signals.v_t)
    return signals, np.array(v_t)


def test_a_steady_motion_has_its_own_velocity():
    signals, _ = fed(0.03 * PERIOD * np.arange(400))
    assert signals.v_t == pytest.approx(0.03, rel=1e-9)


def test_the_velocity_is_late_by_what_is_stated():
    t = PERIOD * np.arange(600)
    _, v_t = fed(0.5 * 0.2 * t**2)
    assert t[-1] - v_t[-1] / 0.2 == pytest.approx(LAGS["v_t"], abs=0.0005)


def test_the_forces_are_late_by_what_is_stated():
    t = PERIOD * np.arange(600)
    signals, _ = fed(np.zeros(600), F_t=10.0 * t)
    late = t[-1] - signals.F_t / 10.0
    assert late == pytest.approx(LAGS["F_t"], abs=PERIOD)


def test_a_slope_is_that_of_the_straight_line_through_its_samples():
    random = np.random.default_rng(1)
    F_t = 3.0 + random.normal(size=300).cumsum() * 0.1
    signals, _ = fed(np.zeros(300), F_t=F_t)
    line = np.polyfit(PERIOD * np.arange(25), F_t[-25:], 1)
    at = FEATURES.index("slope of F_t, 50 ms")
    assert signals.features()[at] == pytest.approx(line[0], rel=1e-9)


def test_a_feature_looks_back_and_never_further_than_its_memory():
    random = np.random.default_rng(2)
    x = 1e-4 * random.normal(size=400).cumsum()
    signals, _ = fed(x)
    at = FEATURES.index("v, 200 ms")
    assert signals.features()[at] == pytest.approx((x[-1] - x[-101]) / 0.2)


def test_features_wait_for_the_samples_that_they_look_back_on():
    assert not fed(np.zeros(100))[0].is_warm
    assert fed(np.zeros(101))[0].is_warm


def test_a_slip_begins_at_speed_and_ends_where_the_foot_is_caught():
    v = np.concatenate([np.full(100, 0.1), np.full(100, 0.2), np.full(100, 0.0)])
    x = PERIOD * v.cumsum()
    assert not fed(x[:100])[0].is_slipping
    assert fed(x[:200])[0].is_slipping
    assert not fed(x)[0].is_slipping


def test_way_and_largest_force_begin_anew_after_a_slip():
    v = np.concatenate([np.full(50, 0.0), np.full(100, 0.3), np.full(150, 0.01)])
    F_t = np.concatenate([np.full(150, 9.0), np.full(150, 4.0)])
    signals, _ = fed(PERIOD * v.cumsum(), F_t=F_t)
    features = dict(zip(FEATURES, signals.features(), strict=True))
    assert features["way since the last slip"] < 0.004
    assert features["F_t over its largest since the last slip"] < 1.01


@pytest.mark.parametrize("force", [0.0, -5.0, 1e6])
def test_features_of_any_force_are_finite(force):
    signals, _ = fed(np.zeros(150), F_t=np.full(150, force), F_n=np.zeros(150))
    assert np.isfinite(signals.features()).all()
