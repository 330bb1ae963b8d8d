"""Inertial force of the foot below the sensor, from its smoothed motion; pure.

The sensor carries the foot, so it reads the ground force less m a of the foot. The
acceleration a is the second derivative of a parabola fitted around each row
(Savitzky and Golay 1964, Anal. Chem. 36(8), 1627-1639).
"""

import math
from typing import NamedTuple

import numpy as np

from acquisition.errors import SettingsError
from analysis.data.filters import local_polynomial
from analysis.data.series import Array

WINDOW = 0.03  # s that one parabola spans; faster changes are smoothed away
_ORDER = 2
_FEWEST = 5  # samples per parabola that its scatter can be estimated from
_FEWEST_ROWS = 0.5  # smallest share of the expected rows that must be present


class InertialForce(NamedTuple):
    """Force that accelerates the foot.

    Attributes:
        force: m a in the frame of the positions [N], shape (n, 3).
        uncertainty: standard uncertainty of each component from the scatter of the
            positions [N]; motion faster than the window is not included.
    """

    force: Array
    uncertainty: float


def inertial_force(t: Array, position: Array, mass: float) -> InertialForce:
    """Return the force that accelerates a body.

    Args:
        t: time [s], shape (n,), strictly increasing.
        position: centre of mass [m], shape (n, 3).
        mass: mass of the body [kg].

    Raises:
        SettingsError: the samples are too few, or too far apart for `WINDOW`.
    """
    from scipy.interpolate import CubicSpline

    period = float(np.median(np.diff(t)))
    count = round((t[-1] - t[0]) / period) + 1
    width = 2 * round(0.5 * WINDOW / period) + 1
    if width < _FEWEST or width > t.size or t.size < _FEWEST_ROWS * count:
        raise SettingsError(
            f"Samples every {period * 1e3:.1f} ms show no acceleration: the foot's "
            f"motion is smoothed over {WINDOW * 1e3:.0f} ms.",
            hint="It needs the cycles of a recording, about 500 a second.",
        )
    even = t[0] + np.arange(count) * period  # so that a lost row makes no false jerk
    evenly = CubicSpline(t, position)(even)
    smooth = local_polynomial(evenly, width, _ORDER)
    force = mass * local_polynomial(evenly, width, _ORDER, deriv=2, step=period)
    inner = slice(width // 2, count - width // 2)  # each end lies on a single parabola
    scatter = float(np.sqrt(np.mean((evenly - smooth)[inner] ** 2)))
    # Least squares on an even grid: variances of 2 c2 and of the residual at the centre
    n = float(width)
    gain = math.sqrt(720.0 / (n * (n**2 - 1) * (n**2 - 4))) / period**2
    left = 1.0 - 3.0 * (3.0 * n**2 - 7.0) / (4.0 * n * (n**2 - 4.0))
    return InertialForce(
        np.column_stack([np.interp(t, even, axis) for axis in force.T]),
        mass * gain * scatter / math.sqrt(left),
    )
