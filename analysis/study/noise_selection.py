"""Choice of a noise model: constant, input-dependent, or input-dependent Student's t.

The scale of "student" depends on the inputs like that of "loglinear". The choice uses
only the training trials, by the log density of trials left out of an inner fit that is
warm-started from the fit to all of them; the simplest model wins unless another is
clearly better.
"""

from dataclasses import replace
from typing import Literal, NamedTuple

import numpy as np

from analysis.data.samples import SampleTable, TrainingSet
from analysis.data.series import Array, Indices
from analysis.gp.refit import refit_gp
from analysis.gp.regression import GaussianProcess
from analysis.study.metrics import Prediction, clearly_best, log_density

NoiseName = Literal["constant", "loglinear", "student"]

NAMES: tuple[NoiseName, ...] = ("constant", "loglinear", "student")
_GROUPS = 3  # of training trials; each is left out once
_NU = (2.1, 60.0)  # practically normal beyond 60, where the density loses digits
_SPREAD = (0.2, 5.0)
_FEWEST = 20  # smallest number of rows outside the chosen ones to estimate tails from
_MOST = 1000  # largest number of these; neighbours in a trial are redundant
_SCORED = 200  # rows scored per held-out trial, at most about twice as many
_JUDGES = 30  # trials scored per group, at most about twice as many


class TailedNoise(NamedTuple):
    """Student's t about the predictions of a process.

    Attributes:
        nu: degrees of freedom.
        spread: scale of the t in predicted standard deviations.
    """

    nu: float
    spread: float

    @classmethod
    def of(
        cls, process: GaussianProcess, training: TrainingSet
    ) -> "TailedNoise | None":
        """Fit the t to training rows outside the chosen ones by maximum likelihood.

        None if there are too few of them. The chosen rows cannot be used: the mean was
        fitted to them, so the noise would look too small.
        """
        from scipy.optimize import minimize

        is_outside = np.ones(training.rows.count, dtype=bool)
        is_outside[training.chosen] = False
        outside = thinned(np.flatnonzero(is_outside), _MOST)
        if outside.size < _FEWEST:
            return None
        rows = training.rows.take(outside)
        normal = predict_normal(process, rows)
        z = (rows.F_t - normal.mean) / normal.scale
        optimum = minimize(
            lambda x: tail_cost(x, z),
            np.log([6.0, 1.0]),
            jac=True,
            method="L-BFGS-B",
            bounds=np.log(np.array([_NU, _SPREAD])),
        )
        return cls(float(np.exp(optimum.x[0])), float(np.exp(optimum.x[1])))

    def applied_to(self, normal: Prediction) -> Prediction:
        """Replace the normal distribution of a prediction by these tails."""
        widening = self.spread * np.sqrt(self.nu / (self.nu - 2.0))
        return Prediction(normal.mean, widening * normal.sd, self.nu)


class NoiseChoice(NamedTuple):
    """The chosen noise and the scores of all candidates.

    Attributes:
        chosen: name of the noise.
        nlpd: mean negative log predictive density of held-out trials, by name.
    """

    chosen: NoiseName
    nlpd: dict[str, float]


def choose_noise(
    training: TrainingSet,
    constant: GaussianProcess,
    changing: GaussianProcess,
    seed: int,
) -> NoiseChoice:
    """Choose the noise that predicts held-out training trials best.

    The trials are left out in up to three groups. A noise other than the constant one
    must be better by one standard error over the trials.

    Args:
        training: training trials, without the test trial of the fold.
        constant: process with constant noise, fitted to the chosen rows.
        changing: the same with input-dependent noise.
        seed: random seed for the rows of the inner fits.
    """
    groups = min(_GROUPS, len(training.lengths))
    if groups < 2:
        return NoiseChoice("constant", {})
    constant, changing = _with_best_start(constant), _with_best_start(changing)
    nlpd = np.concatenate(
        [
            _left_out(training, group, constant, changing, seed)
            for group in range(groups)
        ]
    )
    averages = {str(n): float(x) for n, x in zip(NAMES, nlpd.mean(axis=0), strict=True)}
    return NoiseChoice(NAMES[clearly_best(nlpd)], averages)


def tail_cost(x: Array, z: Array) -> tuple[float, Array]:
    """Return the mean negative log density of Student's t and its slope in x.

    With s the spread and w = z^2 / (nu s^2), up to terms in z alone,

        log s + log(nu)/2 + log G(nu/2) - log G((nu + 1)/2) + (nu + 1)/2 log(1 + w)

    Args:
        x: (log nu, log s).
        z: standardised residuals, shape (n,).
    """
    from scipy.special import digamma, gammaln

    nu = float(np.exp(x[0]))
    w = z * z / (nu * np.exp(2.0 * x[1]))
    mean_log, share = float(np.mean(np.log1p(w))), float(np.mean(w / (1.0 + w)))
    cost = x[1] + 0.5 * x[0] + gammaln(0.5 * nu) - gammaln(0.5 * (nu + 1.0))
    of_nu = digamma(0.5 * nu) - digamma(0.5 * (nu + 1.0)) + mean_log
    slope = [
        0.5 + 0.5 * nu * of_nu - 0.5 * (nu + 1.0) * share,
        1.0 - (nu + 1.0) * share,
    ]
    return float(cost + 0.5 * (nu + 1.0) * mean_log), np.array(slope)


def thinned(rows: Indices, most: int) -> Indices:
    """Return every row, or every k-th if there are at least twice as many as `most`."""
    return rows[:: max(1, rows.size // most)]


def predict_normal(process: GaussianProcess, rows: SampleTable) -> Prediction:
    """Return the prediction of a process for `rows`, noise included."""
    mean, variance = process.predict(rows.inputs)
    return Prediction(mean, np.sqrt(variance))


def _with_best_start(process: GaussianProcess) -> GaussianProcess:
    """Return a process whose refit starts only from its best optimum."""
    return replace(process, starts=(max(process.starts, key=lambda start: start.lml),))


def _left_out(
    training: TrainingSet,
    group: int,
    constant: GaussianProcess,
    changing: GaussianProcess,
    seed: int,
) -> Array:
    """Return the NLPD of a group of held-out trials for every noise, (trials, 3).

    Without tails the noise "student" is normal.
    """
    trial = training.trial_of()
    is_inner = trial % _GROUPS != group
    rows = training.rows.take(np.flatnonzero(is_inner))
    lengths = tuple(n for k, n in enumerate(training.lengths) if k % _GROUPS != group)
    count = min(training.chosen.size, rows.count)
    rng = np.random.default_rng((seed, group))
    inner = TrainingSet(rows, lengths, rng.choice(rows.count, count, replace=False))
    subset = inner.subset
    constant = refit_gp(constant.given(subset.inputs, subset.F_t), subset.F_t)
    changing = refit_gp(changing.given(subset.inputs, subset.F_t), subset.F_t)
    tails = TailedNoise.of(changing, inner)
    left_out = thinned(np.arange(group, len(training.lengths), _GROUPS), _JUDGES)
    judged = [thinned(np.flatnonzero(trial == k), _SCORED) for k in left_out]
    scored = training.rows.take(np.concatenate(judged))
    of_constant = predict_normal(constant, scored)
    of_changing = predict_normal(changing, scored)
    tailed = of_changing if tails is None else tails.applied_to(of_changing)
    densities = np.column_stack(
        [
            log_density(scored.F_t, prediction)
            for prediction in (of_constant, of_changing, tailed)
        ]
    )
    ends = np.cumsum([rows.size for rows in judged])[:-1]
    return np.array([-part.mean(axis=0) for part in np.split(densities, ends)])
