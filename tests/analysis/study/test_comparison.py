import pytest

from analysis.study.metrics import compare, standard_error


def test_the_sign_flip_test_has_the_exact_p_value():
    found = compare([1.0] * 10, [1.1 + 0.01 * k for k in range(10)])
    assert found.p == pytest.approx(2 / 1024)
    assert found.difference == pytest.approx(0.145)
    assert found.trials == 10


def test_equal_models_are_not_distinguished():
    assert compare([1.0, 2.0], [1.0, 2.0]).p == 1.0
    assert compare([0.0, 0.0], [1.0, -1.0]).p == 1.0


def test_many_trials_are_compared_by_random_sign_flips():
    found = compare([0.0] * 20, [1.0, -1.0] * 10)
    assert found.p == 1.0
    assert compare([0.0] * 20, [1.0] * 20).p < 1e-3


def test_a_trial_without_one_of_the_models_is_left_out():
    found = compare([1.0, None, 3.0], [2.0, 5.0, None])
    assert found == (1.0, None, 1.0, 1)
    assert compare([None], [1.0]) is None


def test_standard_error_is_over_trials():
    assert standard_error([1.0, None, 3.0]) == pytest.approx(1.0)
    assert standard_error([1.0]) is None
