"""Climbing with approximations: where it ends, and what it costs."""

import numpy as np
import pytest

from acquisition.errors import SettingsError
from analysis.gp.ascent import Approximated, Top, climb
from analysis.gp.quasi_newton import SearchBox

BOX = SearchBox(np.array([[-4.0, 4.0]] * 3), np.array([1.0, 1.0, 0.5]))
TOP = np.array([0.7, -1.1, 0.4])
BEND = np.array([[3.0, 0.5, 0.0], [0.5, 1.0, 0.2], [0.0, 0.2, 20.0]])


class Counted:
    """A likelihood with one top, which counts its evaluations."""

    def __init__(self, top=TOP, bend=BEND, height=-50.0):
        self.top, self.bend, self.height, self.count = top, bend, height, 0

    def __call__(self, theta):
        self.count += 1
        far = theta - self.top
        quartic = 0.05 * far**3
        value = self.height - 0.5 * far @ self.bend @ far - 0.25 * quartic @ far
        return value, -self.bend @ far - quartic


def approximated(exact, near, reaches=np.inf):
    """Return the objective; its approximation is good that near to the top only."""
    return Approximated(
        exact,
        lambda theta, t: near if np.abs(theta - TOP).max() < reaches else None,
    )


def test_a_poor_approximation_still_leads_to_the_exact_top():
    exact = Counted()
    near = Counted(np.add(TOP, [0.1, -0.2, 0.02]), BEND * 1.2, -49.0)
    end = climb(approximated(exact, near), np.array([-2.0, 2.0, 1.0]), BOX, [])
    np.testing.assert_allclose(end.theta, TOP, atol=1e-3)
    assert end.lml == pytest.approx(-50.0, abs=1e-5)
    plain = climb(Counted(), np.array([-2.0, 2.0, 1.0]), BOX, [])
    assert end.evaluations == exact.count < plain.evaluations


def test_an_approximation_that_is_exact_is_checked_once():
    exact = Counted()
    end = climb(approximated(exact, Counted()), np.array([-2.0, 2.0, 1.0]), BOX, [])
    # climbed to 1e-6 of the likelihood, so one correction may be worth its while
    assert exact.count <= 2
    np.testing.assert_allclose(end.theta, TOP, atol=1e-3)


def test_a_misleading_approximation_is_given_up():
    exact, near = Counted(), Counted(-TOP, -BEND)  # it bends the wrong way
    end = climb(approximated(exact, near), np.zeros(3), BOX, [])
    np.testing.assert_allclose(end.theta, TOP, atol=1e-2)
    assert end.evaluations == exact.count


@pytest.mark.parametrize("reaches", [0.0, 1.0])
def test_without_an_approximation_the_likelihood_is_climbed(reaches):
    exact = Counted()
    objective = approximated(exact, Counted(), reaches)
    end = climb(objective, np.array([-2.0, 2.0, 1.0]), BOX, [])
    np.testing.assert_allclose(end.theta, TOP, atol=1e-2)
    assert end.evaluations == exact.count


def test_the_top_in_the_box_may_lie_on_its_edge():
    exact = Counted(np.add(TOP, [9.0, 0.0, 0.0]))
    near = Counted(np.add(TOP, [9.5, 0.1, 0.0]))
    end = climb(approximated(exact, near), np.zeros(3), BOX, [])
    alone = climb(exact, np.zeros(3), BOX, [])
    assert end.theta[0] == 4.0
    assert end.lml == pytest.approx(alone.lml, abs=1e-5)


def test_a_start_ends_below_a_known_top_after_one_evaluation():
    exact = Counted()
    known = [Top(TOP, -50.0, 9)]
    start = np.array([-2.0, 2.0, 1.0])
    end = climb(approximated(exact, Counted(height=-50.05)), start, BOX, known)
    assert end.evaluations == exact.count == 1
    assert -50.1 < end.lml <= -50.0


def test_beside_a_rough_top_the_likelihood_is_climbed():
    exact, near = Counted(), Counted()
    objective = Approximated(
        exact, lambda theta, t: None if np.abs(theta - TOP).max() < 1.0 else near
    )
    known = [Top(TOP, -50.0, 9)]
    end = climb(objective, np.array([-2.0, 2.0, 1.0]), BOX, known)
    assert near.count == 0
    assert end.evaluations == exact.count
    assert -50.1 < end.lml <= -50.0


def test_an_approximation_without_a_covariance_is_given_up():
    def none(theta):
        raise SettingsError("none")

    exact = Counted()
    end = climb(approximated(exact, none), np.zeros(3), BOX, [])
    np.testing.assert_allclose(end.theta, TOP, atol=1e-2)


def test_a_climb_goes_on_with_the_second_derivatives_of_a_top_beside_it():
    start, spent = np.array([-2.0, 2.0, 1.0]), []
    for bend in (None, BEND):
        exact = Counted()
        end = climb(exact, start, BOX, [Top(TOP, -50.0, 9, bend)])
        assert end.evaluations == exact.count
        assert -50.1 < end.lml <= -50.0
        spent.append(exact.count)
    assert spent[1] < spent[0]


def test_a_climb_that_stands_on_a_ridge_is_climbed_on_by_second_derivatives():
    ridge = np.diag([5.0, 0.02, 20.0])  # its slope promises nothing to a first guess
    exact, near = Counted(bend=ridge), Counted(bend=ridge)
    none_but_last = Approximated(
        exact, lambda theta, t: near if np.isinf(t[1]) else None
    )
    start = np.add(TOP, [0.0, 0.3, 0.0])
    alone = climb(exact, start, BOX, [])
    end = climb(none_but_last, start, BOX, [])
    assert alone.theta[1] == start[1]
    assert end.theta[1] == pytest.approx(TOP[1], abs=0.1)
    assert end.lml > alone.lml


def test_what_ended_below_a_top_is_no_top_to_end_below():
    beside = np.add(TOP, [0.19, 0.0, 0.0])
    known = [Top(TOP, -50.0, 9), Top(beside, -50.06, 3)]
    end = climb(Counted(), np.add(TOP, [1.5, 0.0, 0.0]), BOX, known)
    assert end.lml > -50.1
