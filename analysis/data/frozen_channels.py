"""Detection of wrench channels that are frozen while the foot slides; pure.

Each of the six channels is judged on its own. A cut gauge, a saturated channel or a
stuck bit shows one value, or alternates between two, for much longer than at any other
time. A sensor of coarse resolution does so only briefly, for about as long each time.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.data.series import Array
from ft_sensor.reading import AXES

LONGEST = 0.2  # s that a sound channel may show only two values
_TIMES = 20.0  # multiple of the mean stretch that chance does not exceed
_FROZEN = 2.0  # s with two values at which even the coarsest channel counts as frozen


@dataclass(frozen=True, slots=True)
class FrozenChannel:
    """A channel that measures nothing.

    Attributes:
        axis: 0 to 5: Fx Fy Fz Tx Ty Tz.
        value: median reading while frozen [N, N m].
        seconds: duration without a third value [s].
    """

    axis: int
    value: float
    seconds: float

    @property
    def text(self) -> str:
        """Axis, value and duration in words."""
        unit = "N" if self.axis < 3 else "N m"
        at = f"{AXES[self.axis]} stands at {self.value:.3g} {unit}"
        return f"{at} for {self.seconds:.1f} s"


def frozen_channels(t: Array, wrench: Array) -> list[FrozenChannel]:
    """Return the channels that show one value, or alternate between two, for too long.

    Args:
        t: sampling times without duplicates [s], shape (n,).
        wrench: raw readings while the foot slides [N, N m], shape (n, 6).
    """
    if t.size < 2:
        return []
    step = float(np.median(np.diff(t)))
    channels = (_frozen_channel(wrench[:, k], step, k) for k in range(len(AXES)))
    return [channel for channel in channels if channel is not None]


def _frozen_channel(readings: Array, step: float, axis: int) -> FrozenChannel | None:
    first, end = _two_value_stretches(readings)
    spans = (end - first) * step  # counted in rows, so that a gap adds nothing
    longest = int(spans.argmax())
    seconds = float(spans[longest])
    others = np.delete(spans, longest)
    usual = float(others.mean()) if others.size else 0.0
    if seconds < min(max(LONGEST, _TIMES * usual), _FROZEN):
        return None
    value = float(np.median(readings[first[longest] : end[longest]]))
    return FrozenChannel(axis, value, seconds)


def _two_value_stretches(
    readings: Array,
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return first row and end of every stretch with at most two distinct values."""
    changes = np.flatnonzero(np.diff(readings)) + 1
    begins = np.concatenate([[0], changes])  # of runs of one value
    values = readings[begins]
    ends = np.concatenate([changes, [readings.size]])
    is_third = values[2:] != values[:-2]  # differs from both values before it
    thirds = np.flatnonzero(is_third) + 2
    first = np.concatenate([begins[:1], begins[thirds - 1]])
    end = np.concatenate([ends[thirds - 1], ends[-1:]])
    return first, end
