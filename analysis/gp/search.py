"""The likeliest hyperparameters of a Gaussian process: a good start, and then moves.

Sought is the largest log marginal likelihood, noise prior included,

    log p(y | X, theta) + log p(theta)

(Rasmussen and Williams 2006, section 5.4.1). It has several tops, each another reading
of the rows: a short length and little noise, or a long one and much. One climb misses
the best of them in every fourth fit or so. The first begins at the best of the points
that the kernel offers, by the likelihood of a part of the rows. From the best top
reached, the search then moves to where another top may be, and climbs again, a few
times: the likeliest of the kernel's moves is taken, by the likelihood of all rows, as
the noise is known by then. A climb that comes beside a known top is left there.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from acquisition.errors import SettingsError
from analysis.data.series import Array
from analysis.gp.climb import Climbed, climb
from analysis.gp.kernels import Kernel, Role
from analysis.gp.likelihood import Likelihood
from analysis.gp.noise import Noise
from analysis.gp.proposals import bounds, initial_points, moves
from analysis.gp.trial_noise import TrialRows

_DESIGN_ROWS = 150  # rows by whose likelihood the first start is chosen
_SAME_TOP = (0.2, 0.1)  # in theta and likelihood: a climb so near to a top is left
_LEAST_MOVE = 1.0  # in theta: a move that ends nearer to a known top leads back to it
_ASIDE = 0.3  # in theta: how near to a top another one may be
_BARELY = 0.1  # log likelihood that is lost on the way from one to the other
_PROMISING = 5.0  # log likelihood that a move may be below the best top it leaves
_NEIGHBOURS = 0.5  # in theta: of two tops that are nearer, one is enough to begin with
_LOSING = 5.0  # log likelihood below the best top at which another will not become it
_UNUSED = 4.0  # logarithm of a length or bias beyond which it makes no difference
_NOISE_SCALE = 0.2  # of a logarithm of the noise, which every row tells, to a length's
_AT_BOUND = 1e-3  # in theta: a hyperparameter as near to a bound lies on it


class Start(NamedTuple):
    """One start of a search and what it reached.

    Attributes:
        theta: hyperparameters at its end: a top, or beside the top of another.
        lml: log marginal likelihood there, priors included.
        evaluations: how often the likelihood was evaluated.
    """

    theta: tuple[float, ...]
    lml: float
    evaluations: int


class Optimum(NamedTuple):
    """The best hyperparameters found and every start's result.

    Attributes:
        theta: hyperparameters of largest likelihood.
        lml: log marginal likelihood there, priors included.
        starts: where every start ended.
        began: where it began.
        at_bound: hyperparameters at the edge of the search.
    """

    theta: Array
    lml: float
    starts: tuple[Start, ...]
    began: tuple[Array, ...]
    at_bound: tuple[str, ...]


class Posterior:
    """The log likelihood with the log prior of the noise: what a search climbs.

    Args:
        likelihood: of the rows.
    """

    def __init__(self, likelihood: Likelihood) -> None:
        self.likelihood = likelihood
        self._count = len(likelihood.kernel.names)
        self._values: dict[bytes, float] = {}

    def __call__(self, theta: Array) -> tuple[float, Array]:
        """Return it and its slope in theta.

        Raises:
            SettingsError: the covariance cannot be factorised.
        """
        lml, slope = self.likelihood(theta)
        prior, prior_slope = self.likelihood.noise.log_prior(theta[self._count :])
        slope[self._count :] += prior_slope
        return lml + prior, slope

    def value(self, theta: Array) -> float:
        """Return it alone, for a third of the cost; -inf where there is none.

        Values are kept: moves from one top are asked for again.
        """
        key = theta.tobytes()
        if key not in self._values:
            prior, _ = self.likelihood.noise.log_prior(theta[self._count :])
            try:
                self._values[key] = self.likelihood.value(theta) + prior
            except SettingsError:
                self._values[key] = -np.inf
        return self._values[key]


class Search:
    """A search of the best top: where it has been, and where to go next.

    Args:
        likelihood: of the rows.
    """

    def __init__(self, likelihood: Likelihood) -> None:
        self._kernel, self._noise = likelihood.kernel, likelihood.noise
        self._likelihood, self._posterior = likelihood, Posterior(likelihood)
        self._sd_y, sd_x = float(np.std(likelihood.r)), spread(likelihood.X)
        self._design = [
            np.concatenate([point, self._noise.start(self._sd_y)])
            for point in initial_points(self._kernel, self._sd_y, sd_x)
        ]
        self._bounds = np.vstack(
            [bounds(self._kernel, self._sd_y, sd_x), self._noise.bounds(self._sd_y)]
        )
        parts = self._kernel.names, self._noise.names
        self._scale = np.repeat([1.0, _NOISE_SCALE], [len(names) for names in parts])
        self._began: list[Array] = []
        self._reached: list[Climbed] = []

    def designed_start(self) -> Array:
        """Return the likeliest of the kernel's starts, by a part of the rows."""
        rough = Posterior(self._likelihood.thinned(_DESIGN_ROWS))
        return max(self._design, key=rough.value)

    def climb(self, start: Array) -> None:
        """Climb from a start to its top, or beside one that is known."""
        self._began.append(start)
        reached = climb(
            self._posterior, start, self._bounds, self._is_known, scale=self._scale
        )
        self._reached.append(reached)

    def move(self) -> None:
        """Climb from the likeliest move of every kind, each from the best top so far.

        The points of the design are the last kind. The likelihood is that of all rows,
        with the noise of that top. Moves that end near what is known lead back to it,
        and are left out; so is a kind that promises too little.
        """
        for kind in range(len(self._moves_of(self._best.theta))):
            best = self._best
            known = [*self._began, *(top.theta for top in self._reached)]
            rated = [
                (self._posterior.value(theta), k, theta)
                for k, theta in enumerate(self._moves_of(best.theta)[kind])
                if _distance(self._kernel, theta, known) >= _LEAST_MOVE
            ]
            if rated and max(rated)[0] > best.value - _PROMISING:
                self.climb(max(rated)[2])

    def step_aside(self) -> None:
        """Climb from beside the best top where the likelihood hardly falls.

        Two tops may be nearer to each other than any move goes. What leads back to the
        top that it left is left soon; along what makes no difference nothing is sought.
        """
        best = self._best
        used = [k for k in _shape_of(self._kernel) if best.theta[k] < _UNUSED]
        aside = [
            np.clip(best.theta + size * np.eye(best.theta.size)[k], *self._bounds.T)
            for k in used
            for size in (-_ASIDE, _ASIDE)
        ]
        rated = [(self._posterior.value(theta), k) for k, theta in enumerate(aside)]
        if rated and max(rated)[0] > best.value - _BARELY:
            self.climb(aside[max(rated)[1]])

    def optimum(self) -> Optimum:
        """Return the best of what was reached."""
        best = self._best
        is_edge = np.abs(self._bounds - best.theta[:, None]).min(axis=1) < _AT_BOUND
        names = (*self._kernel.names, *self._noise.names)
        return Optimum(
            best.theta,
            best.value,
            tuple(Start(tuple(x.tolist()), f, n) for x, f, n in self._reached),
            tuple(self._began),
            tuple(name for name, at in zip(names, is_edge, strict=True) if at),
        )

    @property
    def _best(self) -> Climbed:
        return max(self._reached, key=lambda top: top.value)

    def _moves_of(self, theta: Array) -> list[list[Array]]:
        """Return moves from theta in the box, kind by kind, with its noise."""
        count = len(self._kernel.names)
        kinds = [
            *moves(self._kernel, theta[:count]),
            [point[:count] for point in self._design],
        ]
        return [
            [
                np.clip(np.concatenate([move, theta[count:]]), *self._bounds.T)
                for move in kind
            ]
            for kind in kinds
        ]

    def _is_known(self, theta: Array, value: float) -> bool:
        near, low = _SAME_TOP
        return any(
            abs(top.value - value) < low and np.abs(top.theta - theta).max() < near
            for top in self._reached
        )


def likeliest(likelihood: Likelihood) -> Optimum:
    """Return the hyperparameters of largest likelihood times the noise's prior."""
    search = Search(likelihood)
    search.climb(search.designed_start())
    search.move()
    search.step_aside()
    return search.optimum()


def climb_from(
    likelihood: Likelihood, starts: Sequence[Array], *, is_searched: bool = False
) -> Optimum:
    """Return the best top that starts lead to: for where tops are nearly known.

    Args:
        likelihood: of the rows.
        starts: thetas to begin with.
        is_searched: make moves, too: the best top may be none of those known.
    """
    search = Search(likelihood)
    for start in starts:
        search.climb(start)
    if is_searched:
        search.move()
        search.step_aside()
    return search.optimum()


def posterior_search(
    kernel: Kernel,
    noise: Noise,
    X: Array,
    r: Array,
    trials: TrialRows | None = None,
) -> Optimum:
    """Return the hyperparameters of largest likelihood times the noise's prior."""
    return likeliest(Likelihood(kernel, noise, X, r, trials))


def distinct_tops(kernel: Kernel, reached: Sequence[Start]) -> list[Array]:
    """Return the tops that starts reached, best first; no two of them are neighbours.

    Tops too far below the best one are left out.
    """
    tops: list[Array] = []
    ranked = sorted(reached, key=lambda start: -start.lml)
    for start in ranked:
        theta = np.array(start.theta)
        if ranked[0].lml - start.lml > _LOSING:
            break
        if not tops or _distance(kernel, theta, tops) >= _NEIGHBOURS:
            tops.append(theta)
    return tops


def spread(X: Array) -> Array:
    """Return the standard deviation of every column, 1 where it does not vary."""
    sd = X.std(axis=0)
    return np.where(np.ptp(X, axis=0) > 0, sd, 1.0)


def _shape_of(kernel: Kernel) -> list[int]:
    """Return which hyperparameters are lengths and biases."""
    return [k for k, p in enumerate(kernel.parameters) if p.role is not Role.SIZE]


def _distance(kernel: Kernel, theta: Array, others: Sequence[Array]) -> float:
    """Return how far theta is from the nearest of others, in lengths and biases."""
    shape = _shape_of(kernel)
    held = np.minimum(np.vstack([theta, *others])[:, shape], _UNUSED)
    return float(np.abs(held[1:] - held[0]).max(axis=1, initial=0.0).min())
