import numpy as np
import pytest

from acquisition.errors import SettingsError
from analysis.data.series import TractionSeries


def columns(n=10):
    return [0.1 * np.arange(n), np.ones(n), np.ones(n), np.ones(n)]


def test_rows_that_are_not_finite_are_dropped_and_counted():
    t, v, F_n, F_t = columns()
    v[3], F_t[7] = np.nan, np.inf
    series = TractionSeries("S0", "a.csv", t, v, F_n, F_t)
    assert series.dropped_rows == 2
    assert series.t.size == 8
    assert 0.3 not in series.t.round(6)


def test_duplicated_rows_are_dropped_and_counted():
    doubled = [np.repeat(column, 2) for column in columns()]
    series = TractionSeries("S0", "a.csv", *doubled)
    assert series.repeated_rows == 10
    assert series.t.tolist() == columns()[0].tolist()


def test_a_constant_value_is_not_a_duplicated_row():
    assert TractionSeries("S0", "a.csv", *columns()).repeated_rows == 0


def test_arrays_of_a_trial_cannot_be_changed():
    series = TractionSeries("S0", "a.csv", *columns())
    with pytest.raises(ValueError, match="read-only"):
        series.F_n[0] = 5.0


def test_the_callers_arrays_are_not_modified():
    t, v, F_n, F_t = columns()
    series = TractionSeries("S0", "a.csv", t, v, F_n, F_t)
    v[0] = 99.0
    assert series.v_t[0] == 1.0


@pytest.mark.parametrize("step", [0.0, -0.05])
def test_time_that_does_not_increase_is_refused_with_row_and_file(step):
    t, *rest = columns()
    t[4] = t[3] + step
    rest[0][4] = 2.0  # another value: not the same row again
    with pytest.raises(SettingsError, match=r"a\.csv.*row 4"):
        TractionSeries("S0", "a.csv", t, *rest)


def test_columns_of_different_length_are_refused():
    t, v, F_n, F_t = columns()
    with pytest.raises(SettingsError, match="differ in shape"):
        TractionSeries("S0", "a.csv", t, v[:-1], F_n, F_t)


def test_too_few_finite_rows_are_refused():
    t, v, F_n, F_t = columns(4)
    v[:2] = np.nan
    with pytest.raises(SettingsError, match="2 finite rows of 4"):
        TractionSeries("S0", "a.csv", t, v, F_n, F_t)


@pytest.mark.parametrize("name", ["", "x" * 61, "S0\n"])
def test_a_terrain_needs_a_usable_name(name):
    with pytest.raises(SettingsError, match="not a name for a terrain"):
        TractionSeries(name, "a.csv", *columns())


def test_the_rate_follows_from_the_median_step():
    t, *rest = columns()
    t[5:] += 3.0
    assert TractionSeries("S0", "a.csv", t, *rest).rate == pytest.approx(10.0)
