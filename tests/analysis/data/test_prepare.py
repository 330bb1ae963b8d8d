import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.errors import SettingsError
from analysis.data.prepare import (
    MINIMUM_KEPT,
    MINIMUM_TRAVEL_SHARE,
    CoverageShares,
    PrepareOptions,
    foot_velocity,
    moving_average,
    prepare_trial,
    stretches,
)
from analysis.data.series import TractionSeries


@given(
    st.lists(st.floats(-100, 100), min_size=1, max_size=40),
    st.sampled_from([1, 3, 5, 11, 25]),
)
def test_moving_average_is_the_mean_of_the_samples_present(values, width):
    x, half = np.array(values), width // 2
    expected = [x[max(0, i - half) : i + half + 1].mean() for i in range(x.size)]
    # sums of up to 25 numbers of size 100
    np.testing.assert_allclose(moving_average(x, width), expected, atol=1e-11)


def test_velocity_of_a_straight_motion_is_exact_with_uneven_time():
    t = np.array([0.0, 0.002, 0.004, 0.008, 0.010, 0.013])
    position = np.outer(t, [1.0, -2.0, 0.5])
    # differences of numbers near 0.01
    np.testing.assert_allclose(
        foot_velocity(t, position), np.tile([1.0, -2.0, 0.5], (6, 1)), atol=1e-12
    )


def test_velocity_is_central_not_one_sided():
    t = np.arange(5) * 0.1
    assert foot_velocity(t, t**2)[2] == pytest.approx(2 * t[2])
    assert foot_velocity(t, t**2)[0] == pytest.approx(0.1)


def test_velocity_spans_a_short_gap():
    t = np.delete(np.arange(20), [8, 9, 10]) * 0.002
    assert np.all(np.isfinite(foot_velocity(t, t)))


def test_velocity_is_missing_across_a_long_gap():
    t = np.delete(np.arange(20), [8, 9, 10, 11]) * 0.002
    velocity = foot_velocity(t, np.outer(t, [1.0, 1.0]))
    missing = np.flatnonzero(np.isnan(velocity).all(axis=1))
    assert missing.tolist() == [7, 8]


@pytest.mark.parametrize(("step", "found"), [(10, [(0, 8)]), (11, [(0, 4), (4, 8)])])
def test_a_much_longer_step_is_a_gap_of_the_record(step, found):
    assert stretches(np.cumsum([0.0, 1, 1, 1, step, 1, 1, 1])) == found


def test_both_ends_of_the_window_are_kept(make_series):
    v = np.repeat([0.005, 0.0049, 0.2, 0.2001, -0.005], 4)
    options = PrepareOptions(smoothing=1, downsample=1)
    kept = prepare_trial(make_series(v), options)
    assert kept.indices.tolist() == [0, 1, 2, 3, 8, 9, 10, 11]
    shares = kept.shares
    assert (shares.window, shares.sticking) == (0.4, 0.2)
    assert (shares.backward, shares.fast) == (0.2, 0.2)
    assert shares.window_of_moving == pytest.approx(0.5)


def test_thinning_starts_at_the_first_sample_and_comes_after_smoothing(make_series):
    series = make_series(np.full(53, 0.1))
    kept = prepare_trial(series, PrepareOptions())
    assert kept.indices.tolist() == list(range(0, 53, 5))
    assert kept.F_t[4] == pytest.approx(series.F_t[15:26].mean())


def test_travel_is_the_integral_of_velocity(make_series):
    trial = prepare_trial(make_series(np.full(1001, 0.1)), PrepareOptions())
    assert trial.travel == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("kept", "share", "is_countable"),
    [
        *((MINIMUM_KEPT, None, True), (MINIMUM_KEPT - 1, None, False)),
        *((2 * MINIMUM_KEPT, 1.01, True), (2 * MINIMUM_KEPT, 0.99, False)),
    ],
)
def test_a_trial_needs_enough_samples_and_travel(
    make_series, kept, share, is_countable
):
    """`share`: travel relative to the least that the container demands."""
    options = PrepareOptions()
    samples = kept * options.downsample
    least = 0.1 * samples * 0.002  # m at 0.1 m/s and 500 Hz
    if share is not None:
        container = least / MINIMUM_TRAVEL_SHARE / share
        options = PrepareOptions(container_travel=container)
    trial = prepare_trial(make_series(np.full(samples, 0.1)), options)
    assert trial.is_countable is is_countable


def test_travel_of_exactly_the_required_share_is_enough(make_series):
    series = make_series(np.full(2000, 0.1))
    travel = prepare_trial(series, PrepareOptions()).travel
    near, share = travel / MINIMUM_TRAVEL_SHARE, MINIMUM_TRAVEL_SHARE
    container = next(c for c in np.nextafter(near, [near, 0, 1]) if share * c == travel)
    for wanted, is_countable in ((container, True), (container * (1 + 1e-9), False)):
        options = PrepareOptions(container_travel=float(wanted))
        assert prepare_trial(series, options).is_countable is is_countable


@pytest.mark.parametrize(
    "choice",
    [
        {"smoothing": 10},
        {"smoothing": 0},
        {"downsample": 0},
        {"slowest": 0.0},
        {"slowest": 0.3},
        {"fastest": float("nan")},
    ],
)
def test_invalid_options_are_refused(choice):
    with pytest.raises(SettingsError):
        PrepareOptions(**choice)


@pytest.mark.parametrize(
    ("key", "kept"),
    [
        ("S0/02", 704),
        ("S0/08", 552),
        ("S0/00", 745),
        ("B0/02", 605),
        ("B0/04", 508),
        ("B0/05", 806),
        ("TF/05", 693),
        ("TF/07", 807),
        ("TF/08", 832),
    ],
)
def test_kept_samples_agree_with_an_independent_analysis(slice_trials, key, kept):
    (series,) = [s for s in slice_trials[key[:2]] if s.name.endswith(key)]
    # one sample on the edge of the window may fall either way
    assert abs(prepare_trial(series, PrepareOptions()).kept - kept) <= 1


def test_a_foot_that_never_moves_has_no_window_share():
    assert CoverageShares(0.0, 1.0, 0.0, 0.0).window_of_moving is None
    shares = CoverageShares(0.3, 0.4, 0.1, 0.2)
    assert shares.window_of_moving == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("rate", "widths"),
    [
        (500.0, (11, 5)),
        (1000.0, (21, 10)),
        (250.0, (5, 2)),
        (100.0, (3, 1)),
        (20.0, (1, 1)),
    ],
)
def test_smoothing_and_thinning_are_times_and_follow_the_rate(rate, widths):
    t = np.arange(0.0, 4.0, 1.0 / rate)
    series = TractionSeries("S0", "T01", t, 0.1 + 0 * t, 5 + 0.01 * t, 4 + 0.01 * t)
    assert PrepareOptions().widths(series) == widths
    assert prepare_trial(series, PrepareOptions()).widths == widths


def test_prepared_samples_are_not_prepared_again(make_series, moving):
    once = prepare_trial(make_series(moving), PrepareOptions())
    again = TractionSeries(
        *("S0", "kept", once.smooth.t[once.indices], once.v_t, once.F_n, once.F_t),
        is_prepared=True,
    )
    twice = prepare_trial(again, PrepareOptions())
    np.testing.assert_array_equal(twice.v_t, once.v_t)
    np.testing.assert_array_equal(twice.F_t, once.F_t)


@pytest.mark.parametrize("step", [5e-324, 1e-300, 1e-12, 1e-9, 1e-6, 1e3, 1e300])
@pytest.mark.parametrize("last", [None, 1e301, 1e308])
def test_a_time_in_any_unit_takes_no_more_than_the_trial(step, last):
    t = np.arange(2000) * step
    if last is not None:
        t = np.concatenate([t[t < last / 2][:1999], [last]])
    if t.size < 3:
        return
    wave = np.sin(np.arange(t.size))
    series = TractionSeries("S0", "T01", t, 0.1 + 0.01 * wave, 5 + wave, 4 + wave)
    with np.errstate(over="ignore", invalid="ignore"):
        trial = prepare_trial(series, PrepareOptions())
    width, every = trial.widths
    assert 1 <= width <= 2 * t.size + 1
    assert 1 <= every <= t.size
    assert trial.lag is None


def test_too_wide_a_smoothing_is_refused():
    assert PrepareOptions(smoothing=501).smoothing == 501
    with pytest.raises(SettingsError, match="nothing of a slip"):
        PrepareOptions(smoothing=503)


def test_nothing_is_averaged_or_integrated_across_a_gap():
    t = 0.002 * np.arange(1000.0)
    v_t = np.where(t < 1.0, 0.05, 0.15)
    late = np.where(t < 1.0, t, t + 3600.0)
    series = TractionSeries("S0", "gap", late, v_t, v_t, v_t)
    trial = prepare_trial(series, PrepareOptions())
    np.testing.assert_allclose(trial.smooth.v_t, v_t)
    # two stretches of 499 steps
    assert trial.travel == pytest.approx(0.998 * 0.05 + 0.998 * 0.15)


def test_uneven_rows_are_averaged_over_seconds():
    rng = np.random.default_rng(0)
    t = np.cumsum(rng.exponential(0.002, 2000))
    series = TractionSeries("S0", "uneven", t, t, t, t)
    smooth = prepare_trial(series, PrepareOptions()).smooth
    row = 1000
    near = np.abs(t - t[row]) <= 0.011
    assert smooth.v_t[row] == pytest.approx(t[near].mean())
    kept = np.diff(t[prepare_trial(series, PrepareOptions(fastest=100.0)).indices])
    assert np.median(kept) == pytest.approx(0.010, rel=0.05)


def test_uneven_rows_are_thinned_by_time():
    rng = np.random.default_rng(2)
    t = 7.0 + np.cumsum(rng.exponential(0.004, 800))
    v_t = np.full(800, 0.1)
    series = TractionSeries("S0", "uneven", t, v_t, v_t, v_t)
    kept = prepare_trial(series, PrepareOptions()).indices
    numbers = np.floor((t - t[0]) / 0.01)
    first = [int(np.flatnonzero(numbers == number)[0]) for number in np.unique(numbers)]
    assert kept.tolist() == first
