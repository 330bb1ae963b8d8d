"""Random profiles along the container, tabulated on a 1 mm grid."""

import numpy as np

GRID = 0.001  # spacing of the tables [m]
_MARGIN = 0.2  # the tables begin this far before the far end [m]
POINTS = 1200
_LAST = POINTS - 1.001


def smooth_profile(rng: np.random.Generator, length: float) -> np.ndarray:
    """Return unit-variance noise on the grid: white, smoothed by a Gaussian.

    Its autocorrelation at a distance x is exp(-x^2 / (2 length)^2).

    Args:
        rng: generator of the noise.
        length: standard deviation of the Gaussian [m].
    """
    reach = max(int(4.0 * length / GRID), 1)
    taps = np.exp(-0.5 * (np.arange(-reach, reach + 1) * GRID / length) ** 2)
    noise = rng.standard_normal(POINTS + 2 * reach)
    return np.convolve(noise, taps / np.sqrt((taps**2).sum()), "valid")


def value_at(table: list[float], x: float) -> float:
    """Return a tabulated profile at `x` [m], interpolated linearly."""
    position = (x + _MARGIN) / GRID
    if not 0.0 <= position <= _LAST:
        position = 0.0 if position < 0.0 else _LAST
    row = int(position)
    share = position - row
    return table[row] + share * (table[row + 1] - table[row])
