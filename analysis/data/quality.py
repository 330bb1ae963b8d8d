"""Quality of a trial, and coverage of speed and load on a terrain; pure."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.data.prepare import PreparedTrial

SPEED_EDGES = (0.0, 0.01, 0.05, 0.2, np.inf)  # m/s
LOAD_EDGES = (0.0, 2.0, 5.0, 10.0, np.inf)  # N
_SPEED_WORDS = (
    "slower than 0.01 m/s",
    "slower than 0.05 m/s",
    "at 0.05 to 0.2 m/s",
    "faster than 0.2 m/s",
)
_LOAD_WORDS = ("below 2 N", "at 2 to 5 N", "above 5 N", "above 10 N")
# Cells an operator can aim at; the extremes occur by themselves in slips and lift-off.
_AIMS = ((1, 1), (1, 2), (2, 1), (2, 2), (0, 1), (0, 2))
JOINT7_WARNING = 0.020  # motion of the locked joint that is reported [rad]
ENOUGH = 0.02  # smallest share of the samples in a well covered cell
SENSOR_ERROR = 0.4  # N, mean error of the paper's force sensor
# In slips the foot hops, and F_n is then only the error of a sound sensor, which drifts
# by about that much after a tare. The ground cannot pull: an F_n further below zero
# comes from the tare or the plane.
PULLED = 2.0 * SENSOR_ERROR  # N
PULLED_WARNING = 0.03  # share of the kept samples below that


@dataclass(frozen=True, slots=True)
class CoverageGrid:
    """Distribution of the kept samples over speed and load.

    Attributes:
        counts: samples per cell, shape (4, 4), rows speed, columns load.
    """

    counts: NDArray[np.int64]

    @property
    def shares(self) -> NDArray[np.float64]:
        """Share of all samples per cell, shape (4, 4); zeros where there are none."""
        total = self.counts.sum()
        return self.counts / total if total else np.zeros_like(self.counts, float)

    @property
    def fast_share(self) -> float:
        """Share of the samples above 0.2 m/s."""
        return float(self.shares[3].sum())


def coverage(trials: Sequence[PreparedTrial]) -> CoverageGrid:
    """Count the kept samples of `trials` in cells of speed and load."""
    counts = np.zeros((4, 4), np.int64)
    for trial in trials:
        cells, _, _ = np.histogram2d(
            np.abs(trial.v_t), trial.F_n, bins=(SPEED_EDGES, LOAD_EDGES)
        )
        counts += cells.astype(np.int64)
    return CoverageGrid(counts)


def thinnest(grid: CoverageGrid) -> str:
    """Describe the cell with the fewest samples; empty if all are well covered.

    Only cells that an operator can aim at, and with less than 2 % of the samples.
    """
    shares = grid.shares
    if not grid.counts.sum():
        return ""
    thin = min(_AIMS, key=lambda cell: shares[cell])
    if shares[thin] >= ENOUGH:
        return ""
    return f"{_SPEED_WORDS[thin[0]]}, {_LOAD_WORDS[thin[1]]}"


def share_below(trials: Sequence[PreparedTrial], F_n: float) -> float:
    """Return the share of the kept samples at `F_n` [N] or below, 0 without samples."""
    kept = sum(trial.kept for trial in trials)
    below = sum(int(np.count_nonzero(trial.F_n <= F_n)) for trial in trials)
    return below / kept if kept else 0.0


def quick_ratio(trial: PreparedTrial) -> float:
    """Return the least-squares slope of F_t over F_n, NaN without load."""
    power = float(trial.F_n @ trial.F_n)
    return float(trial.F_n @ trial.F_t) / power if power > 0.0 else float("nan")
