"""BFGS in a box: where it ends, and after how many evaluations."""

import numpy as np
import pytest

from acquisition.errors import SettingsError
from analysis.gp.quasi_newton import HOPELESS, Place, SearchBox, Until, maximised

BOX = SearchBox(np.array([[-4.0, 4.0]] * 3), np.array([1.0, 1.0, 0.1]))
TOP = np.array([0.7, -1.1, 0.4])
BEND = np.array([[3.0, 0.5, 0.0], [0.5, 1.0, 0.2], [0.0, 0.2, 300.0]])
FINE = Until(1e-9)


def parabola(theta, top=TOP):
    far = theta - top
    return -0.5 * far @ BEND @ far, -BEND @ far


def bell(theta):
    """Return a hill that bends upwards further than 1 from its top."""
    far = theta - TOP
    value = 20.0 * np.exp(-0.5 * far @ far)
    return value, -value * far


@pytest.mark.parametrize("objective", [parabola, bell])
def test_the_top_is_reached(objective):
    start = Place.at(objective, np.array([-0.8, 0.3, 1.5]))
    end, spent = maximised(objective, start, BOX, FINE)
    np.testing.assert_allclose(end.theta, TOP, atol=1e-4)
    assert spent <= 25


def test_known_second_derivatives_lead_to_the_top_of_a_parabola_in_one_step():
    start = Place.at(parabola, np.add(TOP, [0.5, -0.5, 0.1]), BEND)
    end, spent = maximised(parabola, start, BOX, FINE)
    np.testing.assert_allclose(end.theta, TOP, atol=1e-9)
    assert spent == 1


def test_second_derivatives_are_learnt_on_the_way():
    start = Place.at(parabola, np.array([-0.8, 0.3, 1.5]))
    end, _ = maximised(parabola, start, BOX, Until(1e-14))
    np.testing.assert_allclose(end.bend, BEND, rtol=0.1, atol=0.1)


def test_a_top_outside_the_box_ends_on_its_edge():
    def objective(theta):
        return parabola(theta, np.array([9.0, -9.0, 0.4]))

    seen = []

    def watched(theta):
        seen.append(theta)
        return objective(theta)

    end, _ = maximised(watched, Place.at(watched, np.zeros(3)), BOX, FINE)
    np.testing.assert_array_equal(end.theta[:2], [4.0, -4.0])
    # with two held at the edge the third lies where its own slope vanishes
    assert end.slope[2] == pytest.approx(0.0, abs=1e-3)
    assert np.all(np.abs(seen) <= 4.0)


def test_places_without_a_value_are_gone_round():
    def objective(theta):
        if theta[0] > 1.0:
            raise SettingsError("none")
        return parabola(theta)

    start = Place.at(objective, np.array([0.9, 3.0, 0.0]))
    end, _ = maximised(objective, start, BOX, FINE)
    np.testing.assert_allclose(end.theta, TOP, atol=1e-4)
    nowhere = Place.at(objective, np.array([2.0, 0.0, 0.0]))
    assert (nowhere.lml, maximised(objective, nowhere, BOX, FINE)[1]) == (-HOPELESS, 0)


def test_a_climb_ends_where_it_is_told_to():
    start = Place.at(parabola, np.array([-0.8, 0.3, 1.5]))
    until = Until(1e-9, lambda place: place.lml > -50.0)
    end, spent = maximised(parabola, start, BOX, until)
    whole, more = maximised(parabola, start, BOX, FINE)
    assert -50.0 < end.lml < whole.lml
    assert spent < more
