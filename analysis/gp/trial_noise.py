"""What the rows of one trial share: the variance component of a random effect.

To the covariance of rows i, j of the same trial (E_ij = 1, otherwise 0) is added

    sc^2 E_ij           a level of its own in every trial

(a mixed model, Laird and Ware 1982; Rasmussen and Williams 2006, section 2.7, for
components in the covariance). A new trial shares nothing with the rows fitted to: its
predicted mean is that of the kernel alone, and the component adds to its variance.

It is a `Noise`: theta is that of the noise within a trial, then log sc.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from analysis.data.series import Array, Indices
from analysis.gp.noise import ConstantNoise, Noise

_EFFECT = 0.3  # sc over sd(y) that a search starts with
_SPAN = (-6.0, 1.0)  # of the logarithm of sc over sd(y)


class TrialRows(NamedTuple):
    """Where rows come from; those of one trial stand together.

    Attributes:
        trial: number of the trial of every row, shape (n,).
    """

    trial: Indices

    def take(self, rows: slice) -> "TrialRows":
        """Return a part of the rows."""
        return TrialRows(self.trial[rows])

    def blocks(self) -> list[slice]:
        """Return the rows of every trial."""
        starts = np.flatnonzero(np.diff(self.trial)) + 1
        ends = np.concatenate([[0], starts, [self.trial.size]])
        return [slice(int(a), int(b)) for a, b in pairwise(ends)]


class SharedAt(NamedTuple):
    """Covariances inside the trials at one theta.

    Attributes:
        blocks: rows and their covariance, trial by trial.
        contract: W -> 1/2 sum_ij W_ij dC_ij/dtheta_k of a symmetric W that is given as
            its lower triangle with half of the diagonal; shape (p,).
    """

    blocks: Sequence[tuple[slice, Array]]
    contract: Callable[[Array], Array]


@dataclass(frozen=True, slots=True)
class TrialNoise:
    """Noise within a trial, and the level that its rows share.

    Attributes:
        within: noise of single rows.
    """

    within: Noise = ConstantNoise()  # noqa: RUF009 - it is frozen and has no fields

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the hyperparameters: those within, then that of the level."""
        return (*self.within.names, "log_sc")

    def variance(self, theta: Array, X: Array) -> Array:
        """Return the variance of a measurement of a new trial around the kernel's mean.

        Args:
            theta: hyperparameters of this noise.
            X: standardised inputs, shape (n, d).
        """
        return self.within.variance(theta[:-1], X) + self.level_variance(theta)

    def level_variance(self, theta: Array) -> float:
        """Return the part that is the same for a whole trial, sc^2."""
        return float(np.exp(theta[-1])) ** 2

    def evaluate(
        self, theta: Array, X: Array
    ) -> tuple[Array, Callable[[Array], Array]]:
        """Return variance and contraction of single rows; nothing for what is shared.

        `shared` gives the rest.
        """
        S, contract = self.within.evaluate(theta[:-1], X)
        return S, lambda d: np.append(contract(d), 0.0)

    def shared(self, trials: TrialRows) -> Callable[[Array], SharedAt]:
        """Return what gives the covariances inside the trials for any theta.

        Args:
            trials: where the rows come from.
        """
        parts = trials.blocks()
        return lambda theta: self._shared_at(theta, parts)

    def log_prior(self, theta: Array) -> tuple[float, Array]:
        """Return the prior of the noise within; the level has none."""
        prior, slope = self.within.log_prior(theta[:-1])
        return prior, np.append(slope, 0.0)

    def start(self, sd_y: float) -> Array:
        """Return a start: sc = 0.3 sd(y)."""
        return np.append(self.within.start(sd_y), np.log(_EFFECT * sd_y))

    def bounds(self, sd_y: float) -> Array:
        """Return the logarithm of sc within log sd(y) + [-6, 1]."""
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
    """Return what gives the covariances that rows of one trial share, for any theta.

    There are none unless the noise has such components and the trials are known.
    """
    if isinstance(noise, TrialNoise) and trials is not None:
        return noise.shared(trials)
    return lambda theta: SharedAt((), lambda W: np.zeros(theta.size))
