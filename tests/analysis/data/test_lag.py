"""The lag of a force is estimated, reported and removed."""

from dataclasses import replace

import numpy as np
import pytest

from acquisition.errors import SettingsError
from analysis.data.lag import force_lag
from analysis.data.plausibility import doubts_of
from analysis.data.prepare import PrepareOptions, prepare_trial
from analysis.data.series import TractionSeries

MASS, DAMPING = 4.0, 90.0  # kg, N s/m: of an arm and the hand that holds it


def jamming(late=0.0, rate=500.0, seconds=8.0, seed=0):
    """Return a trial whose force moves a damped mass and is recorded `late` [s]."""
    from scipy.signal import butter, lfilter, sosfilt

    rng = np.random.default_rng(seed)
    fine = 10
    dt = 1.0 / (rate * fine)
    n = int(seconds * rate * fine)
    band = butter(2, (4.0, 60.0), "band", fs=1.0 / dt, output="sos")
    force = np.asarray(sosfilt(band, rng.normal(size=n)))
    force *= 2.0 / force.std()
    decay = np.exp(-DAMPING / MASS * dt)
    swing = lfilter([(1.0 - decay) / DAMPING], [1.0, -decay], -force)
    t = np.arange(n) * dt
    F_t = 5.0 + np.interp(t - late, t, force)
    keep = slice(n // 10, None, fine)
    v_t = 0.08 + np.asarray(swing)[keep] + rng.normal(scale=1e-4, size=n)[keep]
    F_n = np.full(v_t.size, 6.0) + rng.normal(scale=0.3, size=v_t.size)
    return TractionSeries("S0", "T01", t[keep] - t[keep][0], v_t, F_n, F_t[keep])


def lag_of(series):
    return force_lag(series.t, series.v_t, series.F_t)


LATE_MS = (50.0, 75.0, 100.0, 200.0, 333.0, 500.0, 750.0, 1000.0)


@pytest.mark.parametrize("late_ms", [-20.0, -3.0, 0.0, 1.3, 5.0, 20.0, 40.0, *LATE_MS])
def test_an_offset_is_found_accurately(late_ms):
    lag = lag_of(jamming(late_ms * 1e-3))
    assert lag is not None
    assert lag.seconds * 1e3 == pytest.approx(late_ms, abs=0.5)
    assert lag.explained > 0.8


@pytest.mark.parametrize("rate", [250.0, 1000.0])
def test_an_offset_is_found_at_other_rates(rate):
    lag = lag_of(jamming(0.008, rate=rate))
    assert lag is not None
    assert lag.seconds == pytest.approx(0.008, abs=1e-3)


@pytest.mark.parametrize("every", [7, 10, 100])
def test_lost_rows_are_not_an_offset(every):
    series = jamming(0.004)
    left = np.arange(series.t.size) % every != 0
    lag = force_lag(series.t[left], series.v_t[left], series.F_t[left])
    assert lag is not None
    assert lag.seconds == pytest.approx(0.004, abs=1e-3)


@pytest.mark.parametrize("terrain", ["S0", "B10"])
def test_the_offset_of_another_programs_trials_is_small(slice_trials, terrain):
    lags = [lag for s in slice_trials.get(terrain, []) if (lag := lag_of(s))]
    assert all(abs(lag.seconds) < 3e-3 for lag in lags)


def test_a_smooth_slip_gives_no_lag(slice_trials):
    assert [lag_of(series) for series in slice_trials["TF"]] == [None] * len(
        slice_trials["TF"]
    )


def test_a_force_unrelated_to_motion_gives_no_lag():
    series = jamming()
    assert force_lag(series.t, series.v_t, jamming(seed=9).F_t) is None


def test_a_partly_explained_force_gives_no_lag():
    """On a plate the ground's own force varies below 40 Hz, and the noise is above."""
    from scipy.signal import butter, sosfilt

    series, rng = jamming(0.004), np.random.default_rng(3)
    slow, fast = (
        np.asarray(sosfilt(butter(2, band, kind, fs=500.0, output="sos"), noise))
        for band, kind, noise in (
            (15.0, "low", rng.normal(size=series.t.size)),
            (50.0, "high", rng.normal(size=series.t.size)),
        )
    )
    noisy = replace(series, F_t=series.F_t + 6.0 * fast)
    lag = lag_of(noisy)  # the motion explains the force below 40 Hz
    assert lag is not None
    assert lag.explained > 0.65
    assert lag_of(replace(noisy, F_t=noisy.F_t + 4.0 * slow)) is None


@pytest.mark.parametrize(
    "change",
    [
        lambda s: replace(s, v_t=np.zeros_like(s.v_t)),
        lambda s: replace(s, v_t=s.v_t * 1e200, F_t=s.F_t * 1e200),
        lambda s: replace(s, F_t=np.full_like(s.F_t, 3.0)),
        lambda s: replace(s, t=s.t * 1e6),
        lambda s: replace(s, t=s.t * 1e-9),
    ],
)
def test_absurd_trials_give_no_lag(change):
    assert lag_of(change(jamming())) is None


def test_a_very_short_trial_gives_no_lag():
    series = jamming(seconds=0.3)
    assert lag_of(series) is None


def named_doubts(series):
    return {d.name: d for d in doubts_of(prepare_trial(series, PrepareOptions()))}


def test_a_late_force_is_reported_with_its_offset():
    doubt = named_doubts(jamming(0.020))["lag"]
    assert "20 ms late" in doubt.seen
    assert "--what-if lag=20" in doubt.remedy


@pytest.mark.parametrize("late_ms", LATE_MS)
def test_a_force_is_doubted_at_any_searched_lag(late_ms):
    assert f"{late_ms:.0f} ms late" in named_doubts(jamming(late_ms * 1e-3))["lag"].seen


@pytest.mark.parametrize("late_ms", [1100.0, 3000.0])
def test_a_lag_beyond_the_searched_range_is_not_found(late_ms):
    assert lag_of(jamming(late_ms * 1e-3)) is None


@pytest.mark.parametrize("late_ms", [0.0, 100.0, 500.0])
def test_a_short_trial_is_searched_within_its_length(late_ms):
    found = lag_of(jamming(late_ms * 1e-3, seconds=2.3))
    assert found is not None
    assert found.seconds * 1e3 == pytest.approx(late_ms, abs=1.0)
    assert lag_of(jamming(1.0, seconds=1.8)) is None


@pytest.mark.parametrize("late_ms", [0.0, 300.0])
def test_a_periodic_motion_gives_no_lag(late_ms):
    """In a periodic motion a lag of one period looks like no lag."""
    t = np.arange(4000) / 500.0
    phase = 2.0 * np.pi * 15.0 * t
    late = phase - 2.0 * np.pi * 15.0 * late_ms * 1e-3
    series = replace(
        jamming(),
        t=t,
        v_t=0.08 + 0.02 * np.sin(phase),
        F_t=5.0 - 2.0 * np.sin(late + 0.3),
        F_n=np.full(t.size, 6.0),
    )
    assert lag_of(series) is None


def test_an_early_force_is_doubted():
    assert "early" in named_doubts(jamming(-0.015))["lag"].seen


def test_a_force_consistent_with_its_time_stamps_is_not_doubted():
    assert "lag" not in named_doubts(replace(jamming(0.006), stamped_lag=0.006))
    assert "lag" in named_doubts(replace(jamming(0.0), stamped_lag=0.006))


def test_a_small_lag_is_not_doubted():
    assert "lag" not in named_doubts(jamming(0.002))


def after_a_rest(series, F_n, F_t, seconds=1.0):
    """Return the trial after a rest at these forces [N]."""
    count = round(seconds * 500)
    t = np.arange(count) / 500.0
    still = np.zeros(count)
    return replace(
        series,
        t=np.concatenate([t, series.t + seconds]),
        v_t=np.concatenate([still, series.v_t]),
        F_n=np.concatenate([still + F_n, series.F_n]),
        F_t=np.concatenate([still + F_t, series.F_t]),
    )


def test_resting_on_the_traction_column_indicates_swapped_columns():
    assert "swapped" in named_doubts(after_a_rest(jamming(), F_n=0.3, F_t=3.0))


def test_resting_on_the_normal_force_is_not_doubted():
    assert "swapped" not in named_doubts(after_a_rest(jamming(), F_n=3.0, F_t=1.4))


def test_jittered_time_steps_still_give_a_lag():
    series = jamming(0.004)
    t = series.t - 2e-5 * (np.arange(series.t.size) % 3 == 1)
    lag = force_lag(t, series.v_t, series.F_t)
    assert lag is not None
    assert lag.seconds == pytest.approx(0.004, abs=5e-4)


def test_shifting_forces_undoes_the_offset():
    lag = lag_of(jamming(0.020).with_lag_removed(0.020))
    assert lag is not None
    assert abs(lag.seconds) < 0.5e-3


def test_shifting_forces_keeps_velocity_and_time():
    series = jamming()
    later = series.with_lag_removed(0.1)
    count = later.t.size
    np.testing.assert_array_equal(later.v_t, series.v_t[:count])
    assert series.t[-1] - later.t[-1] == pytest.approx(0.1, abs=1e-9)
    np.testing.assert_allclose(later.F_t, series.F_t[50 : 50 + count])


def test_shifting_forces_reduces_their_age():
    stamped = replace(jamming(0.006), stamped_lag=0.006)
    assert stamped.with_lag_removed(0.006).stamped_lag == pytest.approx(0.0)


def test_forces_are_not_shifted_across_gaps():
    with pytest.raises(SettingsError, match="kept samples"):
        replace(jamming(), is_prepared=True).with_lag_removed(0.02)


def test_forces_beyond_the_trial_are_refused():
    with pytest.raises(SettingsError):
        jamming(seconds=1.0).with_lag_removed(60.0)
