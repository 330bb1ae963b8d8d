"""Climbing with approximations: where it ends, and what it costs."""

import numpy as np
import pytest

from acquisition.errors import SettingsError
from analysis.gp.approach import Approximated
from analysis.gp.ascent import Top, climb, refined
from analysis.gp.quasi_newton import SearchBox

BOX = SearchBox(np.array([[-4.0, 4.0]] * 3), np.array([1.0, 1.0, 0.5]))
TOP = np.array([0.7, -1.1, 0.4])
BEND = np.array([[3.0, 0.5, 0.0], [0.5, 1.0, 0.2], [0.0, 0.2, 20.0]])


class Counted:
    """A likelihood with one top, which counts its evaluations.

    As an approximation, it says that its error may be half of `error`.
    """

    def __init__(self, top=TOP, bend=BEND, height=-50.0, error=0.0):
        self.top, self.bend, self.height, self.error = top, bend, height, error
        self.count = 0

    def __call__(self, theta):
        self.count += 1
        far = theta - self.top
        quartic = 0.05 * far**3
        value = self.height - 0.5 * far @ self.bend @ far - 0.25 * quartic @ far
        return value, -self.bend @ far - quartic

    def value(self, theta):
        return self(theta)[0], self.error


def approximated(exact, near, reaches=np.inf):
    """Return the objective; its approximation is good that near to the top only."""
    return Approximated(
        exact,
        lambda theta: exact(theta)[0],
        lambda theta, t: near if np.abs(theta - TOP).max() < reaches else None,
    )


def ended(objective, start, known=()):
    """Return where a start ends that is climbed to the end if it may be the best."""
    top = climb(objective, np.asarray(start), BOX, known)
    return refined(objective, BOX, [*known, top])[-1]


def test_a_poor_approximation_still_leads_to_the_exact_top():
    exact = Counted()
    near = Counted(np.add(TOP, [0.1, -0.2, 0.02]), BEND * 1.2, -49.0)
    end = ended(approximated(exact, near), [-2.0, 2.0, 1.0])
    np.testing.assert_allclose(end.theta, TOP, atol=1e-3)
    assert end.lml == pytest.approx(-50.0, abs=1e-5)
    plain = climb(Counted(), np.array([-2.0, 2.0, 1.0]), BOX, [])
    assert end.evaluations == exact.count < plain.evaluations


def test_an_approximation_that_is_exact_is_checked_once():
    exact = Counted()
    end = ended(approximated(exact, Counted()), [-2.0, 2.0, 1.0])
    # climbed to 1e-6 of the likelihood, so one correction may be worth its while
    assert exact.count <= 2
    np.testing.assert_allclose(end.theta, TOP, atol=1e-3)


def test_a_misleading_approximation_is_given_up():
    exact, near = Counted(), Counted(-TOP, -BEND)  # it bends the wrong way
    end = ended(approximated(exact, near), np.zeros(3))
    np.testing.assert_allclose(end.theta, TOP, atol=1e-2)
    assert end.evaluations == exact.count


@pytest.mark.parametrize("reaches", [0.0, 1.0])
def test_without_an_approximation_the_likelihood_is_climbed(reaches):
    exact = Counted()
    objective = approximated(exact, Counted(), reaches)
    end = ended(objective, [-2.0, 2.0, 1.0])
    np.testing.assert_allclose(end.theta, TOP, atol=1e-2)
    assert end.evaluations == exact.count


def test_the_top_in_the_box_may_lie_on_its_edge():
    exact = Counted(np.add(TOP, [9.0, 0.0, 0.0]))
    near = Counted(np.add(TOP, [9.5, 0.1, 0.0]))
    end = ended(approximated(exact, near), np.zeros(3))
    alone = climb(exact, np.zeros(3), BOX, [])
    assert end.theta[0] == 4.0
    assert end.lml == pytest.approx(alone.lml, abs=1e-5)


def test_a_start_ends_below_a_known_top_by_the_approximation_alone():
    exact = Counted()
    near = Counted(height=-50.05)
    end = ended(approximated(exact, near), [-2.0, 2.0, 1.0], [Top(TOP, -50.0, 9)])
    assert end.evaluations == exact.count == 0
    assert -50.1 < end.lml <= -50.0


@pytest.mark.parametrize(("lead", "is_climbed"), [(0.4, True), (0.6, False)])
def test_only_what_may_be_the_best_top_is_climbed_to_the_end(lead, is_climbed):
    exact = Counted()
    known = [Top(np.add(TOP, [-3.0, 3.0, 0.0]), -50.0 + lead, 9)]
    end = ended(approximated(exact, Counted()), [1.0, -1.5, 0.5], known)
    assert (exact.count > 0) == (end.approach is None) == is_climbed
    np.testing.assert_allclose(end.theta, TOP, atol=1e-2)


def test_a_ridge_of_an_approximation_may_lead_to_a_higher_top():
    ridge = BEND * np.outer([1.0, 0.1, 1.0], [1.0, 0.1, 1.0])
    far = np.add(TOP, [0.0, 3.5, 0.0])
    exact, near = Counted(far, ridge, -48.0), Counted(bend=ridge)
    known = [Top(np.add(TOP, [-3.0, 0.0, 0.0]), -49.0, 9)]
    end = ended(approximated(exact, near), TOP, known)
    assert end.lml == pytest.approx(-48.0, abs=1e-3)


def test_a_top_far_below_the_best_is_left_as_the_approximation_has_it():
    exact, near = Counted(), Counted()
    known = [Top(np.add(TOP, [-3.0, 3.0, 0.0]), -45.0, 9)]
    end = ended(approximated(exact, near), TOP, known)
    assert (exact.count, end.lml) == (0, pytest.approx(-50.0))


def test_where_an_approximation_is_poor_its_top_is_climbed_at_once():
    exact = Counted()
    poor = Approximated(
        exact,
        lambda theta: exact(theta)[0],
        lambda theta, t: Counted(error=1.0) if t[1] > 1.0 else None,
    )
    end = climb(poor, np.zeros(3), BOX, [])
    assert end.approach is None
    assert end.evaluations == exact.count > 0


class Watched:
    """An exact likelihood that tells slopes that were asked for from values."""

    def __init__(self, broken=0.0):
        self.likelihood, self.broken = Counted(), broken
        self.asked = []

    def __call__(self, theta):
        self.asked.append("slope")
        return self.likelihood(theta)

    def value(self, theta):
        self.asked.append("value")
        return self.likelihood(theta)[0] - self.broken


def shifted(exact):
    """Return the objective, with an approximation whose top is 0.001 lower."""
    near = Counted(np.add(TOP, [0.02, 0.02, 0.002]))
    return Approximated(exact, exact.value, lambda theta, t: near)


def test_a_last_step_that_keeps_its_promise_costs_no_slope():
    exact = Watched()
    end = ended(shifted(exact), TOP)
    assert exact.asked == ["slope", "value"]
    assert (end.evaluations, end.lml) == (2, pytest.approx(-50.0, abs=1e-5))


def test_a_step_that_breaks_its_promise_is_not_the_last():
    exact = Watched(broken=0.1)
    end = ended(shifted(exact), TOP)
    assert exact.asked[:3] == ["slope", "value", "slope"]
    assert end.lml == pytest.approx(-50.0, abs=1e-5)
    assert end.evaluations == len(exact.asked)


def test_beside_a_rough_top_the_likelihood_is_climbed():
    exact, near = Counted(), Counted()
    objective = Approximated(
        exact,
        lambda theta: exact(theta)[0],
        lambda theta, t: None if np.abs(theta - TOP).max() < 1.0 else near,
    )
    known = [Top(TOP, -50.0, 9)]
    end = climb(objective, np.array([-2.0, 2.0, 1.0]), BOX, known)
    assert near.count == 0
    assert end.evaluations == exact.count
    assert -50.1 < end.lml <= -50.0


def test_an_approximation_without_a_covariance_is_given_up():
    class WithoutCovariance(Counted):
        def __call__(self, theta):
            raise SettingsError("none")

    exact = Counted()
    end = ended(approximated(exact, WithoutCovariance()), np.zeros(3))
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
        exact,
        lambda theta: exact(theta)[0],
        lambda theta, t: near if np.isinf(t[1]) else None,
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
