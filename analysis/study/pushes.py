"""Detection of pushes: the force rises to a peak, and the foot slips or holds.

A slip begins when smoothed v_t rises above v_slip and ends when it falls below
0.03 m/s. Its peak is the largest F_t from 0.6 s before the onset, but not before the
end of the previous slip, to 0.12 s after. A held push is a local maximum of F_t with a
prominence of at least 1.5 N and a fifth of its value that neither belongs to the
loading of a slip nor is the force spike of re-sticking within 0.15 s of the end of a
slip. Its peak is right-censored: break-away lies above it.

The choice of v_slip matters. At 0.12 m/s, the threshold of `analysis.data.events`, most
"held" pushes have crept away at 0.06 to 0.12 m/s; the censoring then depends on the
strength and every estimate is biased high. The default is 0.06 m/s.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from analysis.data.prepare import PreparedTrial, Smoothed
from analysis.data.series import Array, Indices

V_SLIP = 0.06  # m/s
_END_SPEED = 0.03  # m/s below which a slip has ended
_LOADING = 0.6  # s before the onset in which the peak is searched
_RELEASE = 0.12  # s after the onset in which the peak may still come
_RESTICKING = 0.15  # s after a slip in which a maximum is the re-sticking spike
_PROMINENCE = 1.5  # N, least prominence of a held peak
_PROMINENCE_SHARE = 0.2  # least prominence relative to the peak
_LEAST_PEAK = 0.1  # N below which a peak is sensor noise
_REFERENCE_LOAD = 3.5  # N
_LEAST_LOAD = 1.0  # N, lower limit of the load in the logarithm


@dataclass(frozen=True, slots=True)
class FootPush:
    """One push.

    Attributes:
        t: time of the peak [s].
        peak: largest F_t [N].
        F_n: normal force at the peak [N].
        is_held: the foot did not slip: break-away lies above `peak`.
    """

    t: float
    peak: float
    F_n: float
    is_held: bool


@dataclass(frozen=True)
class PushTable:
    """Pushes of several trials and terrains as columns; rows of a trial are contiguous.

    Attributes:
        log_peak: logarithm of the peak [nat], shape (n,).
        load: log(max(F_n, 1 N) / 3.5 N), shape (n,).
        is_held: right-censored, shape (n,).
        terrain: number of the terrain, from 0, shape (n,).
        trial: number of the trial, from 0 and over all terrains, shape (n,).
    """

    log_peak: Array
    load: Array
    is_held: np.ndarray
    terrain: Indices
    trial: Indices

    @classmethod
    def of(cls, trials: Sequence[tuple[int, Sequence[FootPush]]]) -> "PushTable":
        """Tabulate the pushes of trials, each given with its terrain number."""
        rows = [
            (push.peak, push.F_n, push.is_held, terrain, k)
            for k, (terrain, pushes) in enumerate(trials)
            for push in pushes
        ]
        peak, F_n, is_held, terrain, trial = (
            np.array(rows, dtype=np.float64).reshape(-1, 5).T
        )
        return cls(
            log_peak=np.log(peak),
            load=log_load(F_n),
            is_held=is_held.astype(bool),
            terrain=terrain.astype(np.intp),
            trial=trial.astype(np.intp),
        )

    @property
    def count(self) -> int:
        """Number of pushes."""
        return int(self.log_peak.size)

    @cached_property
    def starts(self) -> Indices:
        """First row of every trial, shape (trials,)."""
        return np.flatnonzero(np.diff(self.trial, prepend=-1))

    @cached_property
    def lengths(self) -> Indices:
        """Number of rows of every trial, shape (trials,)."""
        return np.diff(np.append(self.starts, self.count))


def log_load(F_n: Array) -> Array:
    """Return log(max(F_n, 1 N) / 3.5 N), shape of `F_n` [N]."""
    return np.log(np.maximum(F_n, _LEAST_LOAD) / _REFERENCE_LOAD)


def find_pushes(trial: PreparedTrial, v_slip: float = V_SLIP) -> tuple[FootPush, ...]:
    """Find the pushes of a trial in time order.

    A trial whose rows were prepared before lacks the times at rest and has no pushes.

    Args:
        trial: prepared trial; its whole smoothed record is used.
        v_slip: velocity threshold of a slip [m/s].
    """
    if trial.is_prepared:
        return ()
    smooth = trial.smooth
    slips = _slips(smooth, v_slip)
    peaks = _slip_peaks(smooth, slips)
    pushes = [_push(smooth, row, is_held=False) for row in peaks]
    pushes += [
        _push(smooth, row, is_held=True)
        for row in prominent_maxima(smooth.F_t)
        if _is_held(smooth, row, slips)
    ]
    usable = (push for push in pushes if push.peak >= _LEAST_PEAK)
    return tuple(sorted(usable, key=lambda push: push.t))


def _push(smooth: Smoothed, row: int, *, is_held: bool) -> FootPush:
    return FootPush(
        t=float(smooth.t[row]),
        peak=float(smooth.F_t[row]),
        F_n=float(smooth.F_n[row]),
        is_held=is_held,
    )


def _slips(smooth: Smoothed, v_slip: float) -> list[tuple[int, int]]:
    """Return (first row above v_slip, last row above the end speed) of every slip."""
    slips: list[tuple[int, int]] = []
    is_over = smooth.v_t < min(_END_SPEED, v_slip)
    for row in np.flatnonzero(smooth.v_t > v_slip):
        if slips and row <= slips[-1][1]:
            continue
        below = np.flatnonzero(is_over[row:])
        last = int(row + below[0]) - 1 if below.size else smooth.t.size - 1
        slips.append((int(row), last))
    return slips


def _slip_peaks(smooth: Smoothed, slips: Sequence[tuple[int, int]]) -> list[int]:
    """Return the row of the largest force of every slip."""
    t, rows, before = smooth.t, [], 0
    for onset, last in slips:
        start = max(int(np.searchsorted(t, t[onset] - _LOADING)), before)
        stop = int(np.searchsorted(t, t[onset] + _RELEASE, "right"))
        rows.append(start + int(np.argmax(smooth.F_t[start:stop])))
        before = last + 1
    return rows


def prominent_maxima(F_t: Array) -> list[int]:
    """Return the rows of the prominent local maxima of F_t [N], shape (n,).

    The prominence is the height above the higher of the valleys on both sides, each of
    which ends at the next higher force. Of a maximum of several equal rows, the first.
    """
    is_turn = np.ones(F_t.size, dtype=np.bool_)  # no other row is a maximum or valley
    is_turn[1:-1] = (F_t[1:-1] > F_t[:-2]) != (F_t[2:] > F_t[1:-1])
    rows = np.flatnonzero(is_turn)
    turns = F_t[rows]
    forces: list[float] = turns.tolist()
    prominence = np.minimum(_depths(forces), _depths(forces[::-1])[::-1])[1:-1]
    inner = turns[1:-1]
    is_top = (inner > turns[:-2]) & (inner >= turns[2:])
    is_top &= prominence >= np.maximum(_PROMINENCE, _PROMINENCE_SHARE * inner)
    return rows[1:-1][is_top].tolist()


def _depths(forces: Sequence[float]) -> list[float]:
    """Return the height of every row above the valley since the last higher force."""
    depths: list[float] = []
    higher: list[tuple[float, float]] = []  # falling forces, each with its valley
    for force in forces:
        lowest = force
        while higher and higher[-1][0] <= force:
            lowest = min(lowest, higher.pop()[1])
        higher.append((force, lowest))
        depths.append(force - lowest)
    return depths


def _is_held(smooth: Smoothed, row: int, slips: Sequence[tuple[int, int]]) -> bool:
    """Whether the maximum at `row` is neither loading nor re-sticking of a slip."""
    t = smooth.t
    return not any(
        t[onset] - _LOADING <= t[row] <= t[last] + _RESTICKING for onset, last in slips
    )
