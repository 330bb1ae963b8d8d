"""Search for the hyperparameters with the largest marginal likelihood.

The objective is the log marginal likelihood with the noise prior,

    log p(y | X, theta) + log p(theta)

(Rasmussen and Williams 2006, section 5.4.1). It has several local optima, each a
different interpretation of the data: a short length scale with little noise, or a long
one with much. A single climb misses the best one in about every fourth fit. The first
climb starts at the best of the kernel's starting points by the likelihood of a part of
the rows. From the best optimum so far, the search then moves to where another one may
be and climbs again, a few times: it takes the likeliest of the kernel's moves by the
likelihood of all rows, because the noise is known by then, among those that a part of
the rows ranks first. A climb that approaches a known optimum is stopped, and so is one
far below the best optimum that gains little.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from acquisition.errors import SettingsError
from analysis.data.series import Array
from analysis.gp.climb import ClimbResult, climb
from analysis.gp.kernels import Kernel, Role
from analysis.gp.likelihood import Likelihood
from analysis.gp.noise import Noise
from analysis.gp.proposals import bounds, initial_points, moves
from analysis.gp.trial_noise import TrialRows

_DESIGN_ROWS = 150  # rows used to choose the first start
_MOVE_ROWS = 100  # rows used to choose the moves that are rated by all rows
_RATED = 4  # moves of a kind that are rated by all rows
_SAME_OPTIMUM = (0.2, 0.1)  # in theta and likelihood: a climb this near is stopped
_LEAST_MOVE = 1.0  # in theta: a shorter move leads back to the known optimum
_PROBE = 0.3  # in theta: distance at which a close second optimum is probed
_BARELY = 0.1  # log likelihood that may be lost between the two
_PROMISING = 5.0  # log likelihood that a move may be below the optimum it starts from
# a climb is hopeless that gains less than this share of its shortfall in these steps
_STEPS, _GAIN = 3, 0.3
_SHORTFALL = 0.5  # log likelihood that a climb may be below the best in any case
_NEIGHBOURS = 0.5  # in theta: of two optima nearer than this, one start suffices
_LOSING = 5.0  # log likelihood below the best at which an optimum cannot win any more
_UNUSED = 4.0  # logarithm of a length or bias beyond which it makes no difference
_NOISE_SCALE = 0.2  # scale of log noise, which every row determines, to that of log l
_AT_BOUND = 1e-3  # in theta: distance from a bound that counts as on it


class Start(NamedTuple):
    """Result of one start of a search.

    Attributes:
        theta: final hyperparameters: an optimum, close to one already known, or where a
            climb far below the best was stopped.
        lml: log marginal likelihood there, priors included.
        evaluations: number of likelihood evaluations.
    """

    theta: tuple[float, ...]
    lml: float
    evaluations: int


class Optimum(NamedTuple):
    """The best hyperparameters and the result of every start.

    Attributes:
        theta: hyperparameters of largest likelihood.
        lml: log marginal likelihood there, priors included.
        starts: result of every start.
        start_points: initial theta of every start.
        at_bound: hyperparameters at a bound of the search.
    """

    theta: Array
    lml: float
    starts: tuple[Start, ...]
    start_points: tuple[Array, ...]
    at_bound: tuple[str, ...]


class Posterior:
    """Log likelihood plus log prior of the noise: the objective of a search.

    Args:
        likelihood: likelihood of the rows.
    """

    def __init__(self, likelihood: Likelihood) -> None:
        self.likelihood = likelihood
        self._count = len(likelihood.kernel.names)
        self._values: dict[bytes, float] = {}

    def __call__(self, theta: Array) -> tuple[float, Array]:
        """Return the log posterior and its slope in theta.

        Raises:
            SettingsError: the covariance cannot be factorised.
        """
        lml, slope = self.likelihood(theta)
        prior, prior_slope = self.likelihood.noise.log_prior(theta[self._count :])
        slope[self._count :] += prior_slope
        return lml + prior, slope

    def value(self, theta: Array) -> float:
        """Return the log posterior without slope; -inf where it is undefined.

        Values are cached, because moves from one optimum are evaluated repeatedly.
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
    """Search for the best optimum, with the climbs made so far.

    Args:
        likelihood: likelihood of the rows.
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
        self._reached: list[ClimbResult] = []

    def designed_start(self) -> Array:
        """Return the likeliest of the kernel's starts by a part of the rows."""
        rough = Posterior(self._likelihood.thinned(_DESIGN_ROWS))
        return max(self._design, key=rough.value)

    def climb(self, start: Array) -> None:
        """Climb from a start to its optimum, or until it is known or hopeless."""
        values: list[float] = []

        def is_over(theta: Array, value: float) -> bool:
            values.append(value)
            is_worse = bool(self._reached) and is_hopeless(values, self._best.value)
            return is_worse or self._is_known(theta, value)

        self._began.append(start)
        reached = climb(
            self._posterior, start, self._bounds, is_over, scale=self._scale
        )
        self._reached.append(reached)

    def move(self) -> None:
        """Climb from the likeliest move of every kind, each from the best optimum.

        The kernel's starting points are the last kind. The likeliest moves by a part of
        the rows are rated by all rows, with the noise of that optimum. Moves that end
        near a known optimum are skipped, and so is a kind whose best move is too
        unlikely.
        """
        rough = Posterior(self._likelihood.thinned(_MOVE_ROWS))
        for kind in range(len(self._moves_of(self._best.theta))):
            best = self._best
            visited = [*self._began, *(optimum.theta for optimum in self._reached)]
            new = [
                theta
                for theta in self._moves_of(best.theta)[kind]
                if _distance(self._kernel, theta, visited) >= _LEAST_MOVE
            ]
            if not new:
                continue
            new.sort(key=rough.value, reverse=True)
            likeliest = max(new[:_RATED], key=self._posterior.value)
            if self._posterior.value(likeliest) > best.value - _PROMISING:
                self.climb(likeliest)

    def step_aside(self) -> None:
        """Climb from a point near the best optimum where the likelihood hardly falls.

        Two optima may be closer to each other than any move reaches. A climb that
        returns to the known optimum is stopped early; unused lengths are not probed.
        """
        best = self._best
        used = [k for k in _shape_of(self._kernel) if best.theta[k] < _UNUSED]
        probes = [
            np.clip(best.theta + size * np.eye(best.theta.size)[k], *self._bounds.T)
            for k in used
            for size in (-_PROBE, _PROBE)
        ]
        rated = [(self._posterior.value(theta), k) for k, theta in enumerate(probes)]
        if rated and max(rated)[0] > best.value - _BARELY:
            self.climb(probes[max(rated)[1]])

    def optimum(self) -> Optimum:
        """Return the best optimum reached."""
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
    def _best(self) -> ClimbResult:
        return max(self._reached, key=lambda optimum: optimum.value)

    def _moves_of(self, theta: Array) -> list[list[Array]]:
        """Return moves from theta, clipped to the box, by kind; the noise is kept."""
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
        near, low = _SAME_OPTIMUM
        return any(
            abs(known.value - value) < low and np.abs(known.theta - theta).max() < near
            for known in self._reached
        )


def maximise_posterior(likelihood: Likelihood) -> Optimum:
    """Return the hyperparameters of largest likelihood times the noise's prior."""
    search = Search(likelihood)
    search.climb(search.designed_start())
    search.move()
    search.step_aside()
    return search.optimum()


def climb_from(
    likelihood: Likelihood, starts: Sequence[Array], *, is_searched: bool = False
) -> Optimum:
    """Return the best optimum reached from starts close to the optima.

    Args:
        likelihood: likelihood of the rows.
        starts: initial thetas.
        is_searched: also make moves, because the best optimum may be a new one.
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
    return maximise_posterior(Likelihood(kernel, noise, X, r, trials))


def distinct_optima(kernel: Kernel, reached: Sequence[Start]) -> list[Array]:
    """Return the distinct points that starts reached, best first.

    Those too far below the best optimum are left out.
    """
    optima: list[Array] = []
    ranked = sorted(reached, key=lambda start: -start.lml)
    for start in ranked:
        theta = np.array(start.theta)
        if ranked[0].lml - start.lml > _LOSING:
            break
        if not optima or _distance(kernel, theta, optima) >= _NEIGHBOURS:
            optima.append(theta)
    return optima


def is_hopeless(values: Sequence[float], best: float) -> bool:
    """Whether a climb gains too little to reach the best optimum.

    Args:
        values: log likelihood after every step of the climb.
        best: log likelihood of the best optimum.
    """
    if len(values) <= _STEPS:
        return False
    shortfall, gain = best - values[-1], values[-1] - values[-1 - _STEPS]
    return shortfall > _SHORTFALL and gain < _GAIN * shortfall


def spread(X: Array) -> Array:
    """Return the standard deviation of every column, 1 where it does not vary."""
    sd = X.std(axis=0)
    return np.where(np.ptp(X, axis=0) > 0, sd, 1.0)


def _shape_of(kernel: Kernel) -> list[int]:
    """Return the indices of the lengths and biases."""
    return [k for k, p in enumerate(kernel.parameters) if p.role is not Role.SIZE]


def _distance(kernel: Kernel, theta: Array, others: Sequence[Array]) -> float:
    """Return the distance from theta to the nearest other, in lengths and biases."""
    shape = _shape_of(kernel)
    points = np.minimum(np.vstack([theta, *others])[:, shape], _UNUSED)
    return float(np.abs(points[1:] - points[0]).max(axis=1, initial=0.0).min())
