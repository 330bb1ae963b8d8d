"""Channels of a wrench that show one value while the foot slides; pure.

Each of the six is judged by itself: a gauge that is cut, a channel at its end or stuck
at one bit shows one value, or goes to and fro between two, for longer than it does at
any other time. A sensor of coarse steps does so now and then, and for not much longer
than it usually does.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.data.series import Array
from ft_sensor.reading import AXES

LONGEST = 0.2  # s that a channel may show two values
_TIMES = 20.0  # the usual time with two values, that no chance exceeds
_FROZEN = 2.0  # s with two values, from which even the coarsest channel is frozen


@dataclass(frozen=True, slots=True)
class FrozenChannel:
    """A channel that measures nothing.

    Attributes:
        axis: 0 to 5: Fx Fy Fz Tx Ty Tz.
        value: what it showed [N, N m].
        seconds: for how long without another value [s].
    """

    axis: int
    value: float
    seconds: float

    @property
    def text(self) -> str:
        """Which it is, what it showed and for how long."""
        unit = "N" if self.axis < 3 else "N m"
        at = f"{AXES[self.axis]} stands at {self.value:.3g} {unit}"
        return f"{at} for {self.seconds:.1f} s"


def frozen_channels(t: Array, wrench: Array) -> list[FrozenChannel]:
    """Return the channels that show one value, or two in turn, for too long.

    Args:
        t: when each sample was taken, none twice [s], shape (n,).
        wrench: raw readings while the foot slides [N, N m], shape (n, 6).
    """
    if t.size < 2:
        return []
    step = float(np.median(np.diff(t)))
    judged = (_judged(wrench[:, axis], step, axis) for axis in range(len(AXES)))
    return [found for found in judged if found is not None]


def _judged(shown: Array, step: float, axis: int) -> FrozenChannel | None:
    first, end = _of_two_values(shown)
    spans = (end - first) * step  # by numbers: a gap of the record is no stretch
    longest = int(spans.argmax())
    seconds = float(spans[longest])
    others = np.delete(spans, longest)
    usual = float(others.mean()) if others.size else 0.0
    if seconds < min(max(LONGEST, _TIMES * usual), _FROZEN):
        return None
    value = float(np.median(shown[first[longest] : end[longest]]))
    return FrozenChannel(axis, value, seconds)


def _of_two_values(shown: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return first row and end of every stretch with at most two values."""
    changes = np.flatnonzero(np.diff(shown)) + 1
    begins = np.concatenate([[0], changes])  # of runs of one value
    values = shown[begins]
    ends = np.concatenate([changes, [shown.size]])
    is_third = values[2:] != values[:-2]  # neither of the two before
    thirds = np.flatnonzero(is_third) + 2
    first = np.concatenate([begins[:1], begins[thirds - 1]])
    end = np.concatenate([ends[thirds - 1], ends[-1:]])
    return first, end
