"""How much later than the motion the forces of a trial are; pure.

A foot that slips, jams and slips again moves by the very force that is measured:

    -F_t = M dv/dt + B v        (in a band around 30 Hz; M and B are free)

holds at the offset at which it explains most. M and B are those of the arm and the hand
that pushes it, so neither has to be known. A smooth plate excites nothing, and nothing
is said.
"""

from dataclasses import dataclass

import numpy as np

from analysis.data.series import Array

# Bands [Hz] and the share of the force's variance below which each says nothing; the
# first that explains enough. In the upper one an arm and a hand are a mass with a
# damper and little else; a coarse velocity has noise there. In the lower one the
# ground's force varies too: half of it was explained 4 ms beside the truth.
BANDS = ((10.0, 80.0, 0.5), (3.0, 40.0, 0.65))
LONGEST = 0.05  # s
_SLOWEST_RATE = 200.0  # Hz
_SHORTEST = 1.0  # s of a trial
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
    from scipy.signal import butter, sosfiltfilt

    cuts = (low, min(high, 0.4 * rate))
    filtered = butter(_ORDER, cuts, "band", fs=rate, output="sos")
    motion = sosfiltfilt(filtered, np.stack([np.gradient(v, t), v]))
    force = -np.asarray(sosfiltfilt(filtered, F))
    longest = int(LONGEST * rate)
    # The same rows of motion at every offset, or its ends would decide.
    inner = slice(longest, force.size - longest)
    basis = np.asarray(motion)[:, inner]
    gram = basis @ basis.T
    if not (np.isfinite(gram).all() and np.linalg.cond(gram) < _SINGULAR):
        return ForceLag(0.0, 0.0)
    inverse = np.linalg.inv(gram)
    shares = np.empty(2 * longest + 1)
    for k in range(shares.size):
        shifted = force[k : k + basis.shape[1]]
        products = basis @ shifted
        variance = float(shifted @ shifted)
        explained = float(products @ inverse @ products)
        shares[k] = explained / variance if 0.0 < variance < np.inf else 0.0
    best = int(shares.argmax())
    if not 0 < best < shares.size - 1:  # further off than was looked
        return ForceLag((best - longest) / rate, 0.0)
    before, top, after = shares[best - 1 : best + 2]
    vertex = 0.5 * (before - after) / (before - 2.0 * top + after)
    return ForceLag((best - longest + float(vertex)) / rate, float(top))
