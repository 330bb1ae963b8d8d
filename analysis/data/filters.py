"""Filters of evenly sampled values that shift nothing in time; pure, and numpy alone.

They run after every trial, on the screen's way to the review: scipy.signal takes a
second to be loaded.
"""

from math import factorial

import numpy as np

from analysis.data.series import Array

_SETTLES = 3.0  # periods of the lower corner by which a signal is prolonged


def band_pass(values: Array, low: float, high: float, rate: float, order: int) -> Array:
    """Return values after a Butterworth band pass, run forwards and backwards.

    The gain is the square of the digital filter's (bilinear transform, corners
    prewarped), the phase zero. Before its begin and after its end a signal goes on as
    its own image, turned about the end point.

    Args:
        values: shape (..., n), evenly sampled.
        low: corner [Hz], above zero.
        high: corner [Hz], below half of `rate`.
        rate: samples a second [Hz].
        order: of the low pass that the band pass is made of.
    """
    n = values.shape[-1]
    pad = min(n - 1, round(_SETTLES * rate / low))
    first, last = values[..., :1], values[..., -1:]
    longer = np.concatenate(
        [
            2.0 * first - values[..., pad:0:-1],
            values,
            2.0 * last - values[..., -2 : -pad - 2 : -1],
        ],
        axis=-1,
    )
    frequency = np.fft.rfftfreq(longer.shape[-1], 1.0 / rate)
    warped, (bottom, top) = (
        np.tan(np.pi * f / rate) for f in (frequency[1:], np.array([low, high]))
    )
    detuned = (warped**2 - bottom * top) / (warped * (top - bottom))
    gain = np.zeros(frequency.size)  # no constant passes
    gain[1:] = 1.0 / (1.0 + detuned ** (2 * order))
    passed = np.fft.irfft(gain * np.fft.rfft(longer), longer.shape[-1])
    return passed[..., pad : pad + n]


def local_polynomial(
    values: Array, width: int, order: int, *, deriv: int = 0, step: float = 1.0
) -> Array:
    """Return the polynomial fitted to the samples around each, or a derivative of it.

    The first and the last half of a window lie on the polynomial of the first and the
    last whole one (Savitzky and Golay 1964, Anal. Chem. 36(8), 1627-1639).

    Args:
        values: shape (n, k), evenly sampled, n >= `width`.
        width: samples of one fit, odd.
        order: of the polynomial, below `width`.
        deriv: which derivative; 0 = the value.
        step: between two samples; the unit of the derivative.
    """
    half = width // 2
    fit = np.linalg.pinv(np.vander(np.arange(-half, half + 1), order + 1)[:, ::-1])
    scale = factorial(deriv) / step**deriv
    inner = [np.convolve(v, scale * fit[deriv][::-1], "valid") for v in values.T]
    powers = np.arange(order + 1 - deriv)
    falling = [factorial(p + deriv) / factorial(p) for p in powers]
    x = np.arange(-half, half + 1)[:, None] ** powers * falling / step**deriv
    ends = [x @ (fit[deriv:] @ part) for part in (values[:width], values[-width:])]
    return np.concatenate([ends[0][:half], np.array(inner).T, ends[1][half + 1 :]])
