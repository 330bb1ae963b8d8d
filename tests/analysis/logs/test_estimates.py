"""Estimates from a log: a quiet foot is found whatever the sensor's filter."""

import numpy as np
import pytest

from analysis.logs.estimates import find_normal, find_quiet

RATE = 500.0
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
