"""Filters agree with those of SciPy, whose slow import they avoid."""

import numpy as np
import pytest

from analysis.data.filters import band_pass, local_polynomial

RATE = 500.0


@pytest.fixture
def walk():
    return np.cumsum(np.random.default_rng(1).normal(size=(3, 4000)), axis=1)


@pytest.mark.parametrize(("low", "high"), [(10.0, 80.0), (3.0, 40.0)])
def test_a_band_is_the_zero_phase_passband(walk, low, high):
    from scipy.signal import butter, sosfiltfilt

    wanted = sosfiltfilt(butter(2, (low, high), "band", fs=RATE, output="sos"), walk)
    inner = slice(500, -500)
    passed = band_pass(walk, low, high, RATE, 2)
    assert passed[:, inner] == pytest.approx(wanted[:, inner], abs=1e-4 * wanted.std())


def test_a_band_passes_a_tone_inside_and_removes_one_outside():
    t = np.arange(4000) / RATE
    inside, outside = (np.sin(2 * np.pi * f * t) for f in (28.0, 0.5))
    passed = band_pass(np.stack([inside, outside + 7.0]), 10.0, 80.0, RATE, 2)
    inner = slice(200, -200)
    assert passed[0, inner] == pytest.approx(inside[inner], abs=0.01)
    assert np.abs(passed[1, inner]).max() < 0.01


@pytest.mark.parametrize("deriv", [0, 1, 2])
@pytest.mark.parametrize("order", [2, 3])
def test_a_local_polynomial_agrees_with_savitzky_golay(walk, deriv, order):
    from scipy.signal import savgol_filter

    wanted = savgol_filter(walk.T, 15, order, deriv=deriv, delta=0.002, axis=0)
    fitted = local_polynomial(walk.T, 15, order, deriv=deriv, step=0.002)
    assert fitted == pytest.approx(wanted, abs=1e-9 * np.abs(wanted).max())
