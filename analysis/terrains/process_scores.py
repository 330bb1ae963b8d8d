"""How like a recorded trial a sampled one is: level, texture and events.

The energy score of segments of 0.5 s hardly sees texture, the variogram score does not
see the level (Gneiting and Raftery 2007; Scheuerer and Hamill 2015), and neither counts
events: all three are needed. With paths X_m, the record y and the norm of the root mean
square

    ES = mean_m |X_m - y| - 1/2 mean_{m != m'} |X_m - X_m'|
    VS = mean over lags h of 10 to 250 ms of
         mean_t (|y_t+h - y_t|^0.5 - mean_m |X_m,t+h - X_m,t|^0.5)^2
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from analysis.data.series import Array
from analysis.data.terrain_kinds import FLAT
from analysis.terrains.process_rows import STEP, ProcessTrial

SEGMENT = 50  # samples of the energy score
STONES_DROP, PLATE_DROP = 1.5, 0.4  # N between two extremes of an event

_LAGS = (1, 2, 3, 5, 8, 12, 18, 25)  # samples of the variogram
_SLIP_FROM, _SLIP_SHARE, _SLIP_TIME = 4.0, 0.3, 0.4  # N, of the peak, s


def energy_score(paths: Array, record: Array) -> float:
    """Return the energy score [N] of n paths of a record of T samples.

    Args:
        paths: sampled forces [N], shape (n, T), n at least 2.
        record: recorded forces [N], shape (T,).
    """
    n, whole = len(paths), record.size // SEGMENT * SEGMENT
    X = paths[:, :whole].reshape(n, -1, SEGMENT)
    y = record[:whole].reshape(-1, SEGMENT)
    near = np.sqrt(((X - y) ** 2).mean(axis=2)).mean()
    spread = 0.0
    for k in range(1, n):
        spread += np.sqrt(((X[k:] - X[:-k]) ** 2).mean(axis=2)).sum()
    pairs = n * (n - 1) / 2 * len(y)
    return float(near - 0.5 * spread / pairs)


def variogram_score(paths: Array, record: Array) -> float:
    """Return the variogram score [N] of n paths, shape (n, T), of a record, (T,)."""
    found = []
    for h in _LAGS:
        sampled = np.sqrt(np.abs(paths[:, h:] - paths[:, :-h])).mean(axis=0)
        recorded = np.sqrt(np.abs(record[h:] - record[:-h]))
        found.append(np.mean((recorded - sampled) ** 2))
    return float(np.mean(found))


def least_drop(kind: str) -> float:
    """Return the fall of force [N] that makes an event on a kind of terrain."""
    return PLATE_DROP if kind == FLAT else STONES_DROP


class Events(NamedTuple):
    """What happens along forces, over all of them.

    Attributes:
        drops: falls of force [N].
        ways: way from one drop to the next [m].
        impulses: of force over 0.5 s [N s].
        slips: falls from 4 N or more to less than 0.3 of the peak within 0.4 s.
        way: forward, of all [m].
    """

    drops: Array
    ways: Array
    impulses: Array
    slips: int
    way: float

    @property
    def slips_per_metre(self) -> float:
        """Slips over way [1/m]."""
        return self.slips / max(self.way, 1e-9)

    @property
    def drops_per_metre(self) -> float:
        """Drops over way [1/m]."""
        return self.drops.size / max(self.way, 1e-9)


def events_of(
    forces: Sequence[Array], trials: Sequence[ProcessTrial], least: float
) -> Events:
    """Return the events of forces along the motions of trials.

    Args:
        forces: recorded [N], shape (T,), or of n paths, shape (n, T), by trial.
        trials: whose motions they belong to.
        least: fall of force [N] that makes a drop.
    """
    drops: list[Array] = []
    ways: list[Array] = []
    impulses: list[Array] = []
    slips, way = 0, 0.0
    for paths, trial in zip(forces, trials, strict=True):
        x = STEP * np.cumsum(np.maximum(trial.v_t, 0.0))
        for F in np.atleast_2d(paths):
            peaks, floors = falls(F, least)
            drops.append(F[peaks] - F[floors])
            ways.append(np.diff(x[peaks]))
            whole = F.size // SEGMENT * SEGMENT
            impulses.append(STEP * F[:whole].reshape(-1, SEGMENT).sum(axis=1))
            is_deep = F[floors] < _SLIP_SHARE * F[peaks]
            is_quick = (floors - peaks) * STEP <= _SLIP_TIME
            slips += int((is_deep & is_quick & (F[peaks] >= _SLIP_FROM)).sum())
            way += trial.way
    joined = (np.concatenate([np.zeros(0), *each]) for each in (drops, ways, impulses))
    return Events(*joined, slips=slips, way=way)


def falls(F: Array, least: float) -> tuple[np.ndarray, np.ndarray]:
    """Return peak and floor of every fall between alternating extremes.

    Args:
        F: forces [N], shape (T,).
        least: between two extremes [N].

    Returns:
        Samples of the peaks and of the floors, each of shape (number of falls,).
    """
    steps = np.sign(np.diff(F))
    turning = np.flatnonzero(steps[1:] * steps[:-1] <= 0.0) + 1
    rows = np.concatenate([[0], turning, [F.size - 1]])
    peaks: list[int] = []
    floors: list[int] = []
    high = low = int(rows[0])
    is_rising = True
    values = F.tolist()
    for k in rows.tolist():
        if is_rising:
            if values[k] > values[high]:
                high = k
            elif values[high] - values[k] >= least:
                peaks.append(high)
                low, is_rising = k, False
        elif values[k] < values[low]:
            low = k
        elif values[k] - values[low] >= least:
            floors.append(low)
            high, is_rising = k, True
    if len(floors) < len(peaks):
        floors.append(low)
    return np.array(peaks, dtype=int), np.array(floors, dtype=int)


def ks_distance(first: Array, second: Array) -> float:
    """Return the largest distance between two empirical distributions."""
    if not first.size or not second.size:
        return 1.0
    points = np.concatenate([first, second])
    shares = [
        np.searchsorted(np.sort(x), points, "right") / x.size for x in (first, second)
    ]
    return float(np.abs(shares[0] - shares[1]).max())


def correlation_time(forces: Sequence[Array]) -> float:
    """Return when the pooled autocorrelation first falls below 1/e [s].

    Args:
        forces: of every trial [N], shape (T,) or (n, T).
    """
    paths = [F for each in forces for F in np.atleast_2d(each)]
    mean = float(np.mean(np.concatenate(paths)))
    lag = 0
    variance = np.mean(np.concatenate([(F - mean) ** 2 for F in paths]))
    for lag in range(1, 300):
        pairs = [(F[lag:] - mean) * (F[:-lag] - mean) for F in paths if F.size > lag]
        if not pairs or np.concatenate(pairs).mean() < variance / np.e:
            break
    return lag * STEP
