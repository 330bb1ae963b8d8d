"""Variance component shared by the rows of one trial (random effect).

The covariance of rows i, j of the same trial (E_ij = 1, otherwise 0) is increased by

    sc^2 E_ij           a level of its own in every trial

(a mixed model, Laird and Ware 1982; Rasmussen and Williams 2006, section 2.7, for
components in the covariance). A new trial shares no level with the training rows: its
predicted mean is that of the kernel alone, and the component adds to its variance.

`TrialNoise` is a `Noise`: theta holds the noise within a trial, then log sc.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from analysis.data.series import Array, Indices
from analysis.gp.noise import ConstantNoise, Noise

_EFFECT = 0.3  # initial sc / sd(y) of a search
_SPAN = (-6.0, 1.0)  # bounds of log(sc / sd(y))


class TrialRows(NamedTuple):
    """Trial of every row; rows of one trial are contiguous.

    Attributes:
        trial: trial index of every row, shape (n,).
    """

    trial: Indices

    def take(self, rows: slice) -> "TrialRows":
        """Return the trials of a slice of the rows."""
        return TrialRows(self.trial[rows])

    def blocks(self) -> list[slice]:
        """Return the slice of rows of every trial."""
        starts = np.flatnonzero(np.diff(self.trial)) + 1
        ends = np.concatenate([[0], starts, [self.trial.size]])
        return [slice(int(a), int(b)) for a, b in pairwise(ends)]


class SharedAt(NamedTuple):
    """Covariances within trials at one theta.

    Attributes:
        blocks: rows and covariance of every trial.
        contract: W -> 1/2 sum_ij W_ij dC_ij/dtheta_k, shape (p,), for a symmetric W
            passed as its lower triangle with half of the diagonal.
    """

    blocks: Sequence[tuple[slice, Array]]
    contract: Callable[[Array], Array]


@dataclass(frozen=True, slots=True)
class TrialNoise:
    """Noise within a trial plus the level shared by its rows.

    Attributes:
        within: noise of single rows.
    """

    within: Noise = ConstantNoise()  # noqa: RUF009 - it is frozen and has no fields

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the hyperparameters: noise within a trial, then the level."""
        return (*self.within.names, "log_sc")

    def variance(self, theta: Array, X: Array) -> Array:
        """Return the variance of a measurement in a new trial about the kernel's mean.

        Args:
            theta: hyperparameters of this noise.
            X: standardised inputs, shape (n, d).
        """
        return self.within.variance(theta[:-1], X) + self.level_variance(theta)

    def level_variance(self, theta: Array) -> float:
        """Return the variance of the trial level, sc^2."""
        return float(np.exp(theta[-1])) ** 2

    def evaluate(
        self, theta: Array, X: Array
    ) -> tuple[Array, Callable[[Array], Array]]:
        """Return variance and contraction of single rows, without the shared level.

        `shared` gives the covariance from the level.
        """
        S, contract = self.within.evaluate(theta[:-1], X)
        return S, lambda d: np.append(contract(d), 0.0)

    def shared(self, trials: TrialRows) -> Callable[[Array], SharedAt]:
        """Return a function theta -> covariances within the trials.

        Args:
            trials: trial of every row.
        """
        parts = trials.blocks()
        return lambda theta: self._shared_at(theta, parts)

    def log_prior(self, theta: Array) -> tuple[float, Array]:
        """Return the log prior of the noise within a trial; that of sc is flat."""
        prior, slope = self.within.log_prior(theta[:-1])
        return prior, np.append(slope, 0.0)

    def start(self, sd_y: float) -> Array:
        """Return a start: sc = 0.3 sd(y)."""
        return np.append(self.within.start(sd_y), np.log(_EFFECT * sd_y))

    def bounds(self, sd_y: float) -> Array:
        """Return the bounds; log sc lies in log sd(y) + [-6, 1]."""
        return np.vstack([self.within.bounds(sd_y), np.log(sd_y) + np.array(_SPAN)])

    def _shared_at(self, theta: Array, parts: Sequence[slice]) -> SharedAt:
        variance = self.level_variance(theta)
        blocks = [
            (rows, np.full((rows.stop - rows.start,) * 2, variance)) for rows in parts
        ]

        def contract(W: Array) -> Array:
            inside = sum(float(W[rows, rows].sum()) for rows in parts)
            return np.append(np.zeros(len(self.within.names)), 2.0 * variance * inside)

        return SharedAt(blocks, contract)


def shared_over(noise: Noise, trials: TrialRows | None) -> Callable[[Array], SharedAt]:
    """Return a function theta -> covariances shared by rows of one trial.

    There are none unless the noise is a `TrialNoise` and the trials are known.
    """
    if isinstance(noise, TrialNoise) and trials is not None:
        return noise.shared(trials)
    return lambda theta: SharedAt((), lambda W: np.zeros(theta.size))
