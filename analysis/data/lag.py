"""How much later than the motion the forces of a trial are; pure.

A foot that slips, jams and slips again moves by the very force that is measured:

    -F_t = M dv/dt + B v        (in a band around 30 Hz; M and B are free)

holds at the offset at which it explains most. M and B are those of the arm and the hand
that pushes it, so neither has to be known. A smooth plate excites nothing, and nothing
is said; nor of a motion so regular that several offsets explain it alike.
"""

from dataclasses import dataclass

import numpy as np

from analysis.data.filters import band_pass
from analysis.data.series import Array

# Bands [Hz] and the share of the force's variance below which each says nothing; the
# first that explains enough. In the upper one an arm and a hand are a mass with a
# damper and little else; a coarse velocity has noise there. In the lower one the
# ground's force varies too: half of it was explained 4 ms beside the truth.
BANDS = ((10.0, 80.0, 0.5), (3.0, 40.0, 0.65))
EARLIEST = 0.05  # s of a force before its motion, as far as is looked
LATEST = 1.05  # s of a force after it; a second of lag is inside
_SLOWEST_RATE = 200.0  # Hz
_SHORTEST = 1.0  # s of a trial
_COMPARED = 0.9  # s of motion at least, in a trial too short for all offsets
_APART = 0.1  # s: an offset further off is another one
_CLEAR = 0.75  # share of the best that no other offset may explain
_FEWEST_ROWS = 0.5  # share of its rows that a trial may have lost
_ORDER = 2  # of the band's filter
_SINGULAR = 1e12  # condition number: a foot that never moves


@dataclass(frozen=True, slots=True)
class ForceLag:
    """An offset between force and motion.

    Attributes:
        seconds: how much later the force is [s]; below zero it is earlier.
        explained: share of the force's variance that the motion explains there.
    """

    seconds: float
    explained: float


def force_lag(t: Array, v_t: Array, F_t: Array) -> ForceLag | None:
    """Return how much later the force is; None where the trial does not show it.

    Args:
        t: time [s], shape (n,).
        v_t: velocity [m/s], shape (n,).
        F_t: traction force [N], shape (n,).
    """
    with np.errstate(all="ignore"):
        rate = float(1.0 / np.median(np.diff(t)))
        steps = float((t[-1] - t[0]) * rate)
    is_long = rate >= _SLOWEST_RATE and _SHORTEST * rate <= t.size
    if not (is_long and _FEWEST_ROWS * steps <= t.size):
        return None
    count = round(steps) + 1
    even = t[0] + np.arange(count) / rate  # a lost row is no shift of those behind it
    v, F = np.interp(even, t, v_t), np.interp(even, t, F_t)
    with np.errstate(all="ignore"):  # absurd numbers come to nothing by themselves
        for low, high, least in BANDS:
            lag = _in_band(even, v, F, rate, low, high)
            if lag.explained >= least:
                return lag
    return None


def _in_band(
    t: Array, v: Array, F: Array, rate: float, low: float, high: float
) -> ForceLag:
    """Return the offset at which motion explains most of the force in a band."""
    signals = np.stack([np.gradient(v, t), v, -F])
    *motion, force = band_pass(signals, low, min(high, 0.4 * rate), rate, _ORDER)
    early, late = _reach(force.size, rate)
    # The same rows of motion at every offset, or its ends would decide.
    basis = np.stack(motion)[:, early : force.size - late]
    gram = basis @ basis.T
    if not (np.isfinite(gram).all() and np.linalg.cond(gram) < _SINGULAR):
        return ForceLag(0.0, 0.0)
    inverse = np.linalg.inv(gram)
    shares = np.empty(early + late + 1)
    for k in range(shares.size):
        shifted = force[k : k + basis.shape[1]]
        products = basis @ shifted
        variance = float(shifted @ shifted)
        explained = float(products @ inverse @ products)
        shares[k] = explained / variance if 0.0 < variance < np.inf else 0.0
    best = int(shares.argmax())
    if not _is_clear(shares, best, round(_APART * rate)):
        return ForceLag((best - early) / rate, 0.0)
    before, top, after = shares[best - 1 : best + 2]
    vertex = 0.5 * (before - after) / (before - 2.0 * top + after)
    return ForceLag((best - early + float(vertex)) / rate, float(top))


def _reach(rows: int, rate: float) -> tuple[int, int]:
    """Return by how many rows the force may be early and late.

    A short trial is searched less far, so that enough of its motion is compared.
    """
    early = int(EARLIEST * rate)
    left = rows - early - int(_COMPARED * rate)
    return early, max(early, min(int(LATEST * rate), left))


def _is_clear(shares: Array, best: int, apart: int) -> bool:
    """Return whether the best offset was looked beyond and stands out alone."""
    if not 0 < best < shares.size - 1:  # further off than was looked
        return False
    others = np.concatenate([shares[: max(best - apart, 0)], shares[best + apart :]])
    return bool((others <= _CLEAR * shares[best]).all())
