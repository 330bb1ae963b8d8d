"""Which noise a terrain needs: constant, changing with the inputs, or heavy-tailed too.

"student" is Student's t whose scale changes with the inputs like that of "loglinear".
Chosen among the training trials only, by the log density of trials that were left out
of an inner fit; the simplest wins unless another is clearly better.
"""

from typing import Literal, NamedTuple

import numpy as np

from analysis.data import Array, SampleTable, TrainingSet
from analysis.gp import ConstantNoise, GaussianProcess, LogLinearNoise, fit_gp
from analysis.study.metrics import Prediction, clearly_best, log_density

NoiseName = Literal["constant", "loglinear", "student"]

NAMES: tuple[NoiseName, ...] = ("constant", "loglinear", "student")
_GROUPS = 3  # of training trials; each is left out once
_NU = (2.1, 60.0)  # beyond 60 a normal; without an end the density loses its digits
_SPREAD = (0.2, 5.0)
_FEWEST = 20  # rows outside the chosen ones that tails can be judged by


class TailedNoise(NamedTuple):
    """Student's t around the predictions of a process.

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
        """Return the t of largest density on training rows outside the chosen ones.

        None where too few of them are left: the chosen rows pulled the mean to
        themselves and would make the noise look small.
        """
        from scipy.optimize import minimize

        is_outside = np.ones(training.rows.count, dtype=bool)
        is_outside[training.chosen] = False
        outside = training.rows.take(np.flatnonzero(is_outside))
        if outside.count < _FEWEST:
            return None
        normal = predict_normal(process, outside)

        def cost(x: Array) -> float:
            tails = cls(float(np.exp(x[0])), float(np.exp(x[1])))
            return -float(np.mean(log_density(outside.F_t, tails.applied_to(normal))))

        bounds = np.log(np.array([_NU, _SPREAD]))
        optimum = minimize(cost, np.log([6.0, 1.0]), method="L-BFGS-B", bounds=bounds)
        return cls(float(np.exp(optimum.x[0])), float(np.exp(optimum.x[1])))

    def applied_to(self, normal: Prediction) -> Prediction:
        """Return a normal prediction with these tails in its place."""
        widening = self.spread * np.sqrt(self.nu / (self.nu - 2.0))
        return Prediction(normal.mean, widening * normal.sd, self.nu)


class NoiseChoice(NamedTuple):
    """The noise chosen, and why.

    Attributes:
        chosen: its name.
        nlpd: mean negative log predictive density of left-out trials, by name.
    """

    chosen: NoiseName
    nlpd: dict[str, float]


def choose_noise(training: TrainingSet, points: int, seed: int) -> NoiseChoice:
    """Return the noise that predicts left-out training trials best.

    The trials are left out in up to three groups. Another noise than the constant one
    must be better by one standard error over the trials.

    Args:
        training: the training trials; the trial a fold is tested on is not among them.
        points: rows of an inner fit.
        seed: of the choice of those rows.
    """
    groups = min(_GROUPS, len(training.lengths))
    if groups < 2:
        return NoiseChoice("constant", {})
    nlpd = np.concatenate(
        [_left_out(training, group, points, seed) for group in range(groups)]
    )
    averages = {str(n): float(x) for n, x in zip(NAMES, nlpd.mean(axis=0), strict=True)}
    return NoiseChoice(NAMES[clearly_best(nlpd)], averages)


def predict_normal(process: GaussianProcess, rows: SampleTable) -> Prediction:
    """Return what a process predicts for `rows`, noise included."""
    mean, variance = process.predict(rows.inputs)
    return Prediction(mean, np.sqrt(variance))


def _left_out(training: TrainingSet, group: int, points: int, seed: int) -> Array:
    """Return the NLPD of every trial of a group under every noise, (trials, 3)."""
    trial = training.trial_of()
    is_inner = trial % _GROUPS != group
    inner_rows = training.rows.take(np.flatnonzero(is_inner))
    count = min(points, inner_rows.count)
    rng = np.random.default_rng((seed, group))
    chosen = rng.choice(inner_rows.count, count, replace=False)
    lengths = tuple(n for k, n in enumerate(training.lengths) if k % _GROUPS != group)
    inner = TrainingSet(inner_rows, lengths, chosen)
    subset = inner.subset
    processes = (
        fit_gp(subset.inputs, subset.F_t, None, ConstantNoise()),
        fit_gp(subset.inputs, subset.F_t, None, LogLinearNoise()),
    )
    tails = TailedNoise.of(processes[1], inner)
    return np.array(
        [
            _nlpds(training.rows.take(np.flatnonzero(trial == k)), processes, tails)
            for k in range(group, len(training.lengths), _GROUPS)
        ]
    )


def _nlpds(
    rows: SampleTable,
    processes: tuple[GaussianProcess, GaussianProcess],
    tails: TailedNoise | None,
) -> list[float]:
    """Return the NLPD of one trial under every noise; without tails a normal's."""
    constant, changing = (predict_normal(process, rows) for process in processes)
    tailed = changing if tails is None else tails.applied_to(changing)
    return [
        -float(np.mean(log_density(rows.F_t, prediction)))
        for prediction in (constant, changing, tailed)
    ]
