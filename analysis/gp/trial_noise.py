"""What the rows of one trial share: variance components of a random effect.

To the covariance of rows i, j of the same trial (E_ij = 1, otherwise 0) are added

    sc^2 E_ij           a level of its own in every trial
    sp^2 E_ij f_i f_j   a level in proportion to f = F_n / mean |F_n|

(a mixed model, Laird and Ware 1982; Rasmussen and Williams 2006, section 2.7, for
components in the covariance). A new trial shares nothing with the rows fitted to: its
predicted mean is that of the kernel alone, and both components add to its variance.

The components are a `Noise`: theta is that of the noise within a trial, then log sc
and log sp of those that are there.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from analysis.data.series import Array, Indices
from analysis.gp.noise import ConstantNoise, Noise

_EFFECT = 0.3  # sc or sp over sd(y) that a search starts with
_SPAN = (-6.0, 1.0)  # of the logarithm of a component over sd(y)


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
    """Noise within a trial, and what its rows share.

    Attributes:
        within: noise of single rows.
        has_level: every trial has a level of its own (sc).
        has_ratio: every trial has a level in proportion to F_n (sp).
        load: f at the standardised F_n z is load[0] + load[1] z.
    """

    within: Noise = ConstantNoise()  # noqa: RUF009 - it is frozen and has no fields
    has_level: bool = True
    has_ratio: bool = False
    load: tuple[float, float] = (1.0, 0.0)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the hyperparameters: those within, then the shared ones."""
        return (*self.within.names, *self._shared_names())

    def variance(self, theta: Array, X: Array) -> Array:
        """Return the variance of a measurement of a new trial around the kernel's mean.

        Args:
            theta: hyperparameters of this noise.
            X: standardised inputs, shape (n, d).
        """
        within, _ = self._split(theta)
        return self.within.variance(within, X) + self.trial_variance(theta, X)

    def trial_variance(self, theta: Array, X: Array) -> Array:
        """Return the part that is the same for a whole trial, sc^2 + sp^2 f^2, (n,)."""
        sc, sp = self._components(self._split(theta)[1])
        return sc**2 + (sp * self._relative_load(X)) ** 2

    def evaluate(
        self, theta: Array, X: Array
    ) -> tuple[Array, Callable[[Array], Array]]:
        """Return variance and contraction of single rows; nothing for what is shared.

        `shared` gives the rest.
        """
        within, shared = self._split(theta)
        S, contract = self.within.evaluate(within, X)
        return S, lambda d: np.concatenate([contract(d), np.zeros(shared.size)])

    def shared(self, X: Array, trials: TrialRows) -> Callable[[Array], SharedAt]:
        """Return what gives the covariances inside the trials for any theta.

        Args:
            X: standardised inputs, shape (n, d).
            trials: where these rows come from.
        """
        f = self._relative_load(X)
        parts = [(rows, f[rows]) for rows in trials.blocks()]
        return lambda theta: self._shared_at(theta, parts)

    def log_prior(self, theta: Array) -> tuple[float, Array]:
        """Return the prior of the noise within; the shared components have none."""
        within, shared = self._split(theta)
        prior, slope = self.within.log_prior(within)
        return prior, np.concatenate([slope, np.zeros(shared.size)])

    def start(self, sd_y: float) -> Array:
        """Return a start: sc = sp = 0.3 sd(y)."""
        sizes = [_EFFECT * sd_y, _EFFECT * sd_y]
        shared = np.log(np.array(sizes))[self._present()]
        return np.concatenate([self.within.start(sd_y), shared])

    def bounds(self, sd_y: float) -> Array:
        """Return the logarithms of sc and sp within log sd(y) + [-6, 1]."""
        sizes = [np.log(sd_y) + np.array(_SPAN)] * 2
        shared = np.array(sizes)[self._present()]
        return np.vstack([self.within.bounds(sd_y), shared])

    def _shared_at(
        self, theta: Array, parts: Sequence[tuple[slice, Array]]
    ) -> SharedAt:
        sc, sp = self._components(self._split(theta)[1])
        blocks = [(rows, sc**2 + sp**2 * (f * f[:, None])) for rows, f in parts]

        def contract(W: Array) -> Array:
            sums = np.zeros(2)
            for rows, f in parts:
                inside = W[rows, rows]
                sums += inside.sum(), f @ inside @ f
            slope = sums * [2.0 * sc**2, 2.0 * sp**2]
            padding = np.zeros(len(self.within.names))
            return np.concatenate([padding, slope[self._present()]])

        return SharedAt(blocks, contract)

    def _shared_names(self) -> list[str]:
        names = ("log_sc", "log_sp")
        return [names[k] for k in np.flatnonzero(self._present())]

    def _present(self) -> np.ndarray:
        """Return which of sc and sp are there, shape (2,)."""
        return np.array([self.has_level, self.has_ratio])

    def _split(self, theta: Array) -> tuple[Array, Array]:
        count = len(self.within.names)
        return theta[:count], theta[count:]

    def _components(self, shared: Array) -> Array:
        """Return (sc, sp), 0 for a component that is not there."""
        values = np.zeros(2)
        values[self._present()] = np.exp(shared)
        return values

    def _relative_load(self, X: Array) -> Array:
        return self.load[0] + self.load[1] * X[:, 0]


def shared_over(
    noise: Noise, X: Array, trials: TrialRows | None
) -> Callable[[Array], SharedAt]:
    """Return what gives the covariances that rows of one trial share, for any theta.

    There are none unless the noise has such components and the trials are known.
    """
    if isinstance(noise, TrialNoise) and trials is not None:
        return noise.shared(X, trials)
    return lambda theta: SharedAt((), lambda W: np.zeros(theta.size))
