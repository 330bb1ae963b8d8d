"""How far apart two recorded trials are: their joints since the push began."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquisition.trial_file.reader import TrialReader

Way = NDArray[np.float64]  # joint positions [rad], (cycles, 7)
_MOVED = 2e-3  # rad: the push has begun
_COMPARED = 250  # cycles: half a second of the push
_SHIFT = 5  # cycles, by which the begin of one may be misjudged


def way_of(path: Path) -> Way:
    """Return the positions of a trial's cycles, from where the push begins."""
    return begun(np.asarray(TrialReader(path).cycles().data["position"], np.float64))


def begun(positions: Way) -> Way:
    """Return `positions` [rad], shape (n, 7), from where a joint has moved."""
    moved = np.abs(positions - positions[0]).max(axis=1) > _MOVED
    first = int(moved.argmax()) if moved.any() else len(positions)
    return positions[max(0, first - _SHIFT) :]


def farthest(one: Way, other: Way) -> float:
    """Return how far apart any joint is at most [rad], over half a second of the push.

    A key is pressed at any time of a cycle: the ways may be shifted by a few cycles.
    """
    length = min(_COMPARED, len(one) - 2 * _SHIFT, len(other) - 2 * _SHIFT)
    if length <= 0:
        return float("inf")
    middle = one[_SHIFT : _SHIFT + length]
    return min(
        float(np.abs(middle - other[shift : shift + length]).max())
        for shift in range(2 * _SHIFT + 1)
    )
