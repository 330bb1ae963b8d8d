"""One Gaussian process over several grounds that share a form.

The force on ground g, in trial q, at standardised inputs x:

    f = f_0(x) + d_g(x) + u_q,    f_0 ~ GP(0, s0^2 SE_l),    u_q ~ N(0, sc^2)
    cov(d_g(x), d_h(x')) = A^2 T(g, h) SE_m(x, x')
    T = (1 - own) exp(-(a_g - a_h)^2 / 2 la^2) rho^e F + own [g = h]

f_0 is shared by all grounds, d_g is what stones or plates add. Among stones T falls
with the difference of the inclines a and, by rho, between grain sizes; F does the same
for further factors (`ground`); `own` is what a ground has to itself. A plate is like
itself only: there T = [g = h], and 0 from stones to plates. A, sc and the noise sn are
one value for stones and one for plates.

theta holds logarithms (logits of rho and own). Every one has a normal prior: two plates
alone do not fix a spread between plates. (Rasmussen and Williams 2006, section 2.7 and
eq. 5.9; Gelman et al. 2013, section 5, for hierarchies.)
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from acquisition.errors import SettingsError
from analysis.data.series import Array
from analysis.gp.climb import climb
from analysis.gp.ground import (
    BASE,
    FactorTerm,
    Ground,
    GroundRows,
    Resemblance,
    terms_of,
)
from analysis.gp.kernels import SquaredExponential
from analysis.gp.likelihood import Factor, factorise

NAMES = (
    *("log_s0", "log_l1", "log_l2", "log_A_stones", "log_A_plate"),
    *("log_m1", "log_m2", "log_la", "logit_rho", "logit_own"),
    *("log_sc_stones", "log_sc_plate", "log_sn_stones", "log_sn_plate"),
)
# means and standard deviations; sizes in N at the median force, la in degrees
_PRIOR = np.array(
    [
        *((1.5, 0.7), (0.7, 1.0), (0.7, 1.0), (0.7, 0.7), (0.4, 0.7)),
        *((0.7, 1.0), (0.7, 1.0), (np.log(15.0), 0.7), (1.0, 1.5), (-3.0, 1.0)),
        *((np.log(0.6), 0.7), (np.log(0.3), 0.7), (np.log(2.5), 1.0)),
        (np.log(0.4), 1.0),
    ]
)
# of every further factor: a length over the spread of a number, a share of a word
_LENGTH_PRIOR, _SHARE_PRIOR = (0.7, 1.0), (1.0, 1.5)
_IS_SIZE = np.array([n[4:].partition("_")[0] in {"s0", "A", "sc", "sn"} for n in NAMES])
_SEARCHED_SD = 4.0  # prior standard deviations that the search goes
_TOLERANCE = 1e-7  # share of the value that the last step of a climb gains less than
_BLOCK = 500  # rows predicted at a time


class GroundLikelihood:
    """The log likelihood of rows of several grounds, for any theta.

    Args:
        rows: the rows; outputs are taken as they are.
        X: their standardised inputs, shape (n, 2).
        terms: the factors that the model takes.
    """

    def __init__(
        self, rows: GroundRows, X: Array, terms: Sequence[FactorTerm] = ()
    ) -> None:
        self._y, self._is_plate = rows.y, rows.is_plate
        self._ground = rows.ground
        self._present = sorted(set(rows.ground.tolist()))
        grounds = [rows.grounds[g] for g in self._present]
        self._resemblance = Resemblance(grounds, grounds, terms)
        self._starts = np.flatnonzero(np.diff(rows.ground, prepend=-1))
        self._ground_index = np.searchsorted(self._present, rows.ground)
        self._trials = rows.blocks()
        self._shared = SquaredExponential().over(X, X)
        self._added = SquaredExponential().over(X, X)

    def __call__(self, theta: Array) -> tuple[float, Array]:
        """Return the log likelihood and its gradient in theta, shape (14 + k,).

        Raises:
            SettingsError: the covariance cannot be factorised.
        """
        K0, of_shared = self._shared(theta[:3])
        unit, of_added = self._added(np.concatenate([[0.0], theta[5:7]]))
        B, slopes = self._resemblance.at(theta)
        wide = B[np.ix_(self._ground_index, self._ground_index)]
        factor = _factor(K0 + wide * unit, theta, self._is_plate, self._trials)
        a = factor.solve(self._y)
        lml = -0.5 * float(self._y @ a + a.size * np.log(2.0 * np.pi))
        lml -= float(np.log(np.diagonal(factor.L)).sum())
        W = 0.5 * (np.outer(a, a) - factor.inverse())
        by_ground = np.add.reduceat(
            np.add.reduceat(W * unit, self._starts, axis=0), self._starts, axis=1
        )
        slope = np.zeros(theta.size)
        for k, derivative in slopes.items():
            slope[k] = (by_ground * derivative).sum()
        slope[5:7] = of_added(W * wide)[1:]
        slope[10:BASE] = self._noise_slopes(W, theta)
        slope[:3] = of_shared(W)
        return lml, slope

    def _noise_slopes(self, W: Array, theta: Array) -> Array:
        """Return the slopes of log sc and log sn, each of stones and plates."""
        slopes, variances = np.zeros(4), np.exp(2.0 * theta[10:BASE])
        diagonal = np.diagonal(W)
        for rows in self._trials:
            is_plate = int(self._is_plate[rows.start])
            slopes[is_plate] += W[rows, rows].sum()
            slopes[2 + is_plate] += diagonal[rows].sum()
        return 2.0 * slopes * variances


@dataclass(frozen=True, slots=True)
class GroundPrediction:
    """Latent force of a new trial on one ground, in the unit of the outputs.

    Attributes:
        mean: shape (m,).
        latent: variance of the function f_0 + d_g, shape (m,).
        noise: variance of single rows, sn^2.
        between: variance between trials, sc^2.
    """

    mean: Array
    latent: Array
    noise: float
    between: float


@dataclass(frozen=True, slots=True, eq=False)
class GroundProcess:
    """The process with its hyperparameters, given rows.

    Attributes:
        theta: hyperparameters, in the order of `names_of`.
        terms: the factors that it takes.
        rows: what it is given; outputs around `offset`.
        centre: of the inputs, shape (2,).
        scale: standard deviation of the inputs, shape (2,).
        offset: mean of the outputs that the process is around.
        objective: log likelihood and prior where theta was searched.
    """

    theta: Array
    terms: tuple[FactorTerm, ...]
    rows: GroundRows
    centre: Array
    scale: Array
    offset: float
    objective: float

    def given(self, rows: GroundRows) -> "PredictiveProcess":
        """Return the process given rows, ready to predict.

        Raises:
            SettingsError: the covariance cannot be factorised.
        """
        return PredictiveProcess(self, rows)

    def describe(self) -> dict[str, float]:
        """Return the hyperparameters by name."""
        return dict(zip(names_of(self.terms), self.theta.tolist(), strict=True))


class PredictiveProcess:
    """Predicts any ground from rows of some.

    Args:
        process: hyperparameters and standardisation.
        rows: rows that are known, outputs in the same unit as those of `process`.
    """

    def __init__(self, process: GroundProcess, rows: GroundRows) -> None:
        self._process, self._rows = process, rows
        self._X = (rows.inputs - process.centre) / process.scale
        theta = process.theta
        B = Resemblance(rows.grounds, rows.grounds, process.terms).at(theta)[0]
        K = _covariance(theta, self._X, None, B[np.ix_(rows.ground, rows.ground)])
        self._factor = _factor(K, theta, rows.is_plate, rows.blocks())
        self._alpha = self._factor.solve(rows.y - process.offset)

    def predict(self, ground: Ground, inputs: Array) -> GroundPrediction:
        """Return the force of a new trial on a ground, known or not, at m inputs."""
        process, theta = self._process, self._process.theta
        Z = (inputs - process.centre) / process.scale
        related = Resemblance(self._rows.grounds, [ground], process.terms)
        B = related.at(theta)[0][self._rows.ground]
        own = Resemblance([ground], [ground], process.terms).at(theta)[0][0, 0]
        prior = np.exp(2.0 * theta[0]) + own
        mean, latent = np.empty(len(Z)), np.full(len(Z), prior)
        for i in range(0, len(Z), _BLOCK):
            part = slice(i, i + _BLOCK)
            cross = _covariance(theta, self._X, Z[part], B)
            mean[part] = process.offset + self._alpha @ cross
            half = self._factor.half(cross)
            latent[part] -= np.einsum("nm,nm->m", half, half)
        sc2, sn2 = _by_surface(theta, np.array([float(ground.is_plate)]))
        return GroundPrediction(
            mean, np.maximum(latent, 0.0), float(sn2[0]), float(sc2[0])
        )

    def covariance(self, grounds: Sequence[Ground], point: Array) -> Array:
        """Return the covariance of f_0 + d_g on k grounds at one input, shape (k, k).

        Args:
            grounds: known or not.
            point: the input, shape (1, 2).
        """
        process, theta = self._process, self._process.theta
        z = (point - process.centre) / process.scale
        related = Resemblance(self._rows.grounds, grounds, process.terms)
        B = related.at(theta)[0][self._rows.ground]
        cross = _covariance(theta, self._X, np.repeat(z, len(grounds), axis=0), B)
        half = self._factor.half(cross)
        own = Resemblance(grounds, grounds, process.terms).at(theta)[0]
        return np.exp(2.0 * theta[0]) + own - half.T @ half


class GroundPosterior:
    """Log likelihood plus log prior of theta, given rows: what a search climbs.

    Args:
        rows: a few hundred rows of all grounds.
        unit: of the outputs, over N at the median force.

    Raises:
        SettingsError: fewer than two rows.
    """

    def __init__(self, rows: GroundRows, unit: float = 1.0) -> None:
        if rows.y.size < 2:
            raise SettingsError(
                "A model of all terrains needs samples.", hint="Record some trials."
            )
        self.rows, self.centre = rows, rows.inputs.mean(axis=0)
        scale = rows.inputs.std(axis=0)
        self.scale = np.where(scale > 0.0, scale, 1.0)
        levels = [rows.y[rows.ground == g].mean() for g in np.unique(rows.ground)]
        self.offset = float(np.mean(levels))
        centred = replace(rows, y=rows.y - self.offset)
        self.terms = terms_of(rows.grounds)
        self._likelihood = GroundLikelihood(
            centred, (rows.inputs - self.centre) / self.scale, self.terms
        )
        self._mean, self._sd = prior_of(unit, self.terms)

    def __call__(self, theta: Array) -> tuple[float, Array]:
        """Return the value and its gradient in theta, shape (14 + k,).

        Raises:
            SettingsError: the covariance cannot be factorised.
        """
        lml, slope = self._likelihood(theta)
        far = (theta - self._mean) / self._sd
        return lml - 0.5 * float(far @ far), slope - far / self._sd

    def climbed(self, start: Mapping[str, float] | None = None) -> GroundProcess:
        """Return the process at the top that a start leads to.

        Args:
            start: hyperparameters to begin with by name; of those that it lacks, and
                by default, the priors' centre.
        """
        begin = self._mean.copy()
        for index, name in enumerate(names_of(self.terms)):
            begin[index] = (start or {}).get(name, begin[index])
        best = climb(
            self,
            begin,
            self._mean[:, None] + self._sd[:, None] * [-_SEARCHED_SD, _SEARCHED_SD],
            tolerance=_TOLERANCE,
        )
        return GroundProcess(
            theta=best.theta,
            terms=self.terms,
            rows=self.rows,
            centre=self.centre,
            scale=self.scale,
            offset=self.offset,
            objective=best.value,
        )


def in_unit(theta: Array, ratio: float) -> Array:
    """Return theta for outputs in a unit that is 1 / `ratio` times the old one."""
    changed = theta.copy()
    changed[:BASE] += np.log(ratio) * _IS_SIZE
    return changed


def names_of(terms: Sequence[FactorTerm]) -> tuple[str, ...]:
    """Return the names of the hyperparameters, those of further factors last."""
    return (*NAMES, *(term.parameter for term in terms))


def prior_of(unit: float, terms: Sequence[FactorTerm] = ()) -> tuple[Array, Array]:
    """Return means and standard deviations of the priors of theta, each (14 + k,).

    Args:
        unit: of the outputs, over N at the median force.
        terms: the factors that the model takes.
    """
    further = [_SHARE_PRIOR if term.is_word else _LENGTH_PRIOR for term in terms]
    mean, sd = np.array([*_PRIOR.tolist(), *further]).T
    mean[:BASE] += np.log(unit) * _IS_SIZE
    return mean, sd


def _by_surface(theta: Array, is_plate: Array) -> tuple[Array, Array]:
    """Return sc^2 and sn^2 of rows on stones and plates, each of shape (n,)."""
    surface = is_plate.astype(int)
    variances = np.exp(2.0 * theta[10:BASE])
    return variances[:2][surface], variances[2:][surface]


def _factor(K: Array, theta: Array, is_plate: Array, trials: Sequence[slice]) -> Factor:
    """Return the factor of K with trial effects and noise.

    Args:
        K: covariance of f_0 + d_g, shape (n, n).
        theta: hyperparameters.
        is_plate: 1 for a row on a plate, shape (n,).
        trials: the rows of every trial.
    """
    sc2, sn2 = _by_surface(theta, is_plate)
    shared = [
        (rows, np.full((rows.stop - rows.start,) * 2, sc2[rows.start]))
        for rows in trials
    ]
    return factorise(K, sn2, blocks=shared)


def _covariance(theta: Array, X: Array, X_other: Array | None, B: Array) -> Array:
    """Return the covariance of f_0 + d_g between two sets of rows, shape (n, m).

    Of one set with itself, `X_other` None, only the upper triangle is good.
    """
    over = SquaredExponential().over(X, X_other)
    shared, _ = over(theta[:3])
    K = shared.copy()
    added, _ = over(np.concatenate([[0.0], theta[5:7]]))
    return K + B * added
