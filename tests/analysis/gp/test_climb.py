import numpy as np
import pytest

from acquisition.errors import SettingsError
from analysis.gp.climb import climb

BOX = np.array([[-4.0, 4.0]] * 3)
TOP = np.array([0.7, -1.1, 0.4])
CURVATURE = np.array([[3.0, 0.5, 0.0], [0.5, 1.0, 0.2], [0.0, 0.2, 20.0]])
START = np.array([-2.0, 2.0, 1.0])


def hill(theta, top=TOP):
    distance = theta - top
    return -50.0 - 0.5 * distance @ CURVATURE @ distance, -CURVATURE @ distance


def test_the_optimum_is_reached():
    optimum = climb(hill, START, BOX)
    np.testing.assert_allclose(optimum.theta, TOP, atol=1e-3)
    assert optimum.value == pytest.approx(-50.0, abs=1e-6)
    assert optimum.evaluations < 30


def test_an_optimum_outside_the_box_ends_on_its_edge():
    optimum = climb(lambda theta: hill(theta, np.add(TOP, [9.0, 0.0, 0.0])), START, BOX)
    assert optimum.theta[0] == 4.0


def test_a_start_outside_the_box_is_clamped():
    optimum = climb(hill, START - 9.0, BOX)
    np.testing.assert_allclose(optimum.theta, TOP, atol=1e-3)


def test_points_without_a_likelihood_are_avoided():
    def objective(theta):
        if theta[0] > 1.0:
            raise SettingsError("none")
        return hill(theta)

    optimum = climb(objective, START, BOX)
    np.testing.assert_allclose(optimum.theta, TOP, atol=1e-2)


def test_a_climb_stops_on_request():
    optimum = climb(hill, START, BOX, lambda theta, value: value > -60.0)
    assert -60.0 < optimum.value < -50.01
    assert optimum.value == pytest.approx(hill(optimum.theta)[0])
    assert optimum.evaluations < climb(hill, START, BOX).evaluations


def test_a_start_without_a_likelihood_ranks_below_every_optimum():
    def objective(theta):
        raise SettingsError("none")

    optimum = climb(objective, START, BOX)
    np.testing.assert_array_equal(optimum.theta, START)
    assert optimum.value == -np.inf


def test_scaling_saves_evaluations_and_keeps_the_optimum():
    scale = 1.0 / np.sqrt(np.diagonal(CURVATURE))
    optimum = climb(hill, START, BOX, scale=scale)
    np.testing.assert_allclose(optimum.theta, TOP, atol=1e-3)
    assert optimum.evaluations < climb(hill, START, BOX).evaluations


def test_theta_is_unscaled_at_the_box_edge_and_on_an_early_stop():
    scale, errors = np.array([0.3, 3.0, 0.07]), []
    top = np.add(TOP, [9.0, 0.0, 0.0])

    def is_known(theta, value):
        errors.append(abs(hill(theta, top)[0] - value))
        return False

    optimum = climb(lambda theta: hill(theta, top), START, BOX, is_known, scale=scale)
    assert optimum.theta[0] == 4.0
    assert max(errors) < 1e-9
