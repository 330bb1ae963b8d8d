"""Zero-phase filters for evenly sampled values; pure, NumPy only.

They run after every trial before the review appears; importing scipy.signal would
delay it by a second.
"""

from math import factorial

import numpy as np

from analysis.data.series import Array

_SETTLES = 3.0  # periods of the lower corner by which a signal is padded


def band_pass(values: Array, low: float, high: float, rate: float, order: int) -> Array:
    """Apply a Butterworth band pass forwards and backwards.

    The gain is the square of the digital filter's (bilinear transform, prewarped
    corners), the phase zero. Both ends are padded by odd reflection about the end
    point.

    Args:
        values: shape (..., n), evenly sampled.
        low: corner [Hz], above zero.
        high: corner [Hz], below half of `rate`.
        rate: samples a second [Hz].
        order: order of the low-pass prototype.
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
    gain = np.zeros(frequency.size)  # zero gain at DC
    gain[1:] = 1.0 / (1.0 + detuned ** (2 * order))
    passed = np.fft.irfft(gain * np.fft.rfft(longer), longer.shape[-1])
    return passed[..., pad : pad + n]


def local_polynomial(
    values: Array, width: int, order: int, *, deriv: int = 0, step: float = 1.0
) -> Array:
    """Savitzky-Golay filter: local polynomial fit, or its derivative, at every sample.

    The first and last half window are evaluated on the polynomial of the first and
    last full window (Savitzky and Golay 1964, Anal. Chem. 36(8), 1627-1639).

    Args:
        values: shape (n, k), evenly sampled, n >= `width`.
        width: samples per fit, odd.
        order: order of the polynomial, below `width`.
        deriv: order of the derivative; 0 = the value.
        step: sampling interval; sets the unit of the derivative.
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
