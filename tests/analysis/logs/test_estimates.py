"""Estimates from a log: a quiet foot is found whatever the sensor's filter."""

import numpy as np
import pytest

from analysis.logs.estimates import find_normal, find_quiet, find_sole

RATE = 500.0
UP = np.array([0.0, 0.0, 1.0])
T = np.arange(0.0, 12.0, 1.0 / RATE)
IS_LIFTED = T < 5.0
HEIGHT = np.where(IS_LIFTED, 0.05, 0.0)


def readings(cut_off):
    """White noise of 0.05 N through a first-order low-pass, and a load from 5 s on."""
    white = np.random.default_rng(1).normal(0.0, 0.05, (len(T), 6))
    share = 1.0 if cut_off is None else 1.0 - np.exp(-2 * np.pi * cut_off / RATE)
    noise, last = np.empty_like(white), np.zeros(6)
    for k, row in enumerate(white):
        noise[k] = last = last + share * (row - last)
    return noise + np.where(IS_LIFTED, 0.0, 8.0 + np.sin(20.0 * T))[:, None]


@pytest.mark.parametrize("cut_off", [None, 50.0, 20.0, 10.0])
def test_a_quiet_foot_is_found_behind_any_filter(cut_off):
    quiet = find_quiet(T, readings(cut_off), HEIGHT)
    assert quiet[IS_LIFTED].mean() > 0.9
    assert not quiet[~IS_LIFTED].any()


def test_a_heaving_path_is_no_plane_with_a_level_normal():
    """Of a foot that rises and falls by 30 mm along a straight path."""
    x = np.linspace(0.0, 0.5, 200)
    foot = np.column_stack([x, np.zeros(200), 0.015 * np.sin(60.0 * x)])
    normal = find_normal(foot)
    assert normal.value == pytest.approx((0.0, 0.0, 1.0), abs=0.05)
    assert "assumed level sideways" in normal.how


def pushed(arm, wander, along=1.0, rows=2000):
    """Force and moment of a point `arm` [m] under the origin, its place wandering."""
    rng = np.random.default_rng(2)
    load = 10.0 + 2.0 * np.sin(np.arange(rows) / 50.0)
    friction = along * rng.choice([0.25, 0.6], rows) * load
    force = np.column_stack([-friction, rng.normal(0.0, 0.1, rows), load])
    at = np.zeros((rows, 3))
    at[:, 0], at[:, 2] = rng.normal(0.0, wander, rows), -arm
    return force, np.cross(at, force) + 0.3  # a moment that no tare removed


@pytest.mark.parametrize("arm", [0.0, 0.005, 0.05])
def test_moments_of_friction_show_the_height_of_a_sole(arm):
    estimate = find_sole(*pushed(arm, 0.0), UP)
    assert estimate.value == pytest.approx([-1e3 * arm], abs=0.1)


def test_a_wandering_centre_of_pressure_widens_the_estimate():
    narrow, wide = (find_sole(*pushed(0.05, by), UP) for by in (1e-4, 2e-3))
    assert narrow.spread[0] < wide.spread[0]
    assert abs(wide.value[0] + 50.0) < wide.spread[0]
    assert find_sole(*pushed(0.05, 0.02), UP).value == ()


def test_a_force_of_one_direction_shows_no_height():
    force, moment = pushed(0.05, 0.0, along=0.0)
    force[:, 1] = 0.0
    assert find_sole(force, moment, UP).how == "the force keeps its direction"
