"""Lag of the measured force behind the motion; pure.

A foot that slips, jams and slips again is driven by the force that is measured:

    -F_t = M dv/dt + B v        (in a band around 30 Hz; M and B are fitted)

The lag is the offset at which this relation explains most of the force. M and B belong
to the arm and the hand that pushes it and need not be known. There is no result on a
smooth plate, which excites nothing, nor for a motion so periodic that several offsets
explain it equally well.
"""

from dataclasses import dataclass

import numpy as np

from analysis.data.filters import band_pass
from analysis.data.series import Array

# Bands (low, high) [Hz] with the share of the force's variance that each must explain;
# the first one that does is used. In the upper band, arm and hand act as a mass with a
# damper, but a coarsely quantised velocity is noisy there. In the lower band the ground
# force varies too: an offset wrong by 4 ms explained half of the variance.
BANDS = ((10.0, 80.0, 0.5), (3.0, 40.0, 0.65))
EARLIEST = 0.05  # s, largest lead of the force that is searched
LATEST = 1.05  # s, largest lag that is searched; includes a lag of one second
_SLOWEST_RATE = 200.0  # Hz
_SHORTEST = 1.0  # s of a trial
_COMPARED = 0.9  # s of motion compared at least, in a trial too short for all offsets
_RIVAL_DISTANCE = 0.1  # s beyond which another offset counts as a rival
_CLEAR = 0.75  # share of the best explanation that no rival offset may reach
_FEWEST_ROWS = 0.5  # smallest share of the expected rows that must be present
_ORDER = 2  # of the band pass
_SINGULAR = 1e12  # condition number of a foot that never moves


@dataclass(frozen=True, slots=True)
class ForceLag:
    """Time offset between force and motion.

    Attributes:
        seconds: lag of the force [s]; negative if it leads.
        explained: share of the force's variance explained by the motion at this lag.
    """

    seconds: float
    explained: float


def force_lag(t: Array, v_t: Array, F_t: Array) -> ForceLag | None:
    """Estimate the lag of the force; None if the trial does not determine it.

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
    even = t[0] + np.arange(count) / rate  # a lost row must not shift later rows
    v, F = np.interp(even, t, v_t), np.interp(even, t, F_t)
    with np.errstate(all="ignore"):  # absurd values fail the later checks
        for low, high, least in BANDS:
            lag = _in_band(even, v, F, rate, low, high)
            if lag.explained >= least:
                return lag
    return None


def _in_band(
    t: Array, v: Array, F: Array, rate: float, low: float, high: float
) -> ForceLag:
    """Return the offset at which the motion explains most of the force in a band."""
    signals = np.stack([np.gradient(v, t), v, -F])
    *motion, force = band_pass(signals, low, min(high, 0.4 * rate), rate, _ORDER)
    early, late = _search_range(force.size, rate)
    # The same rows of motion at every offset; otherwise the ends would decide.
    basis = np.stack(motion)[:, early : force.size - late]
    gram = basis @ basis.T
    if not (np.isfinite(gram).all() and np.linalg.cond(gram) < _SINGULAR):
        return ForceLag(0.0, 0.0)
    products = np.stack([np.correlate(force, row, "valid") for row in basis])
    explained = np.sum(products * (np.linalg.inv(gram) @ products), axis=0)
    # Summed anew at every offset: a difference of running sums could lose all digits.
    variance = np.correlate(force * force, np.ones(basis.shape[1]), "valid")
    is_usable = (variance > 0.0) & (variance < np.inf)
    shares = np.divide(
        explained, variance, out=np.zeros(early + late + 1), where=is_usable
    )
    best = int(shares.argmax())
    if not _is_unique(shares, best, round(_RIVAL_DISTANCE * rate)):
        return ForceLag((best - early) / rate, 0.0)
    before, top, after = shares[best - 1 : best + 2]
    vertex = 0.5 * (before - after) / (before - 2.0 * top + after)
    return ForceLag((best - early + float(vertex)) / rate, float(top))


def _search_range(rows: int, rate: float) -> tuple[int, int]:
    """Return the largest lead and lag of the force to search [rows].

    In a short trial the range is smaller, so that enough of the motion is compared.
    """
    early = int(EARLIEST * rate)
    available = rows - early - int(_COMPARED * rate)
    return early, max(early, min(int(LATEST * rate), available))


def _is_unique(shares: Array, best: int, distance: int) -> bool:
    """Return whether the best offset is inside the search range and has no rival."""
    if not 0 < best < shares.size - 1:  # the optimum may lie outside the range
        return False
    rivals = np.concatenate(
        [shares[: max(best - distance, 0)], shares[best + distance :]]
    )
    return bool((rivals <= _CLEAR * shares[best]).all())
