"""Repeatability of the trials of a terrain, and how they change from first to last."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from analysis.data.prepare import PreparedTrial
from analysis.data.samples import SampleTable
from analysis.data.series import Array
from analysis.study.metrics import PairedComparison, compare
from analysis.study.models import GP_SE, GP_SE_NOISE, GpModel
from analysis.study.noise_selection import NAMES
from analysis.study.study import Study
from analysis.study.terrain_fit import TerrainResult, mean_of
from analysis.tustin.identifiability import correlation_samples

MEAN_FORCE, TRACTION_RATIO, MEAN_LOAD = "F_t", "F_t/F_n", "F_n"
TREND_UNITS = {MEAN_FORCE: "N", TRACTION_RATIO: "1", MEAN_LOAD: "N"}
SIGNIFICANT = 2.0  # standard errors that a slope must exceed to be called one


@dataclass(frozen=True, slots=True)
class Trend:
    """A straight line through one mean per trial.

    Attributes:
        trials: numbers of the trials that have kept samples, from 1, shape (n,).
        means: one mean per trial, shape (n,).
        slope: change from one trial to the next; None below three trials.
        slope_error: its standard error.
        start: height of the line at trial 0; the overall mean without a slope.
    """

    trials: Array
    means: Array
    slope: float | None
    slope_error: float | None
    start: float

    @property
    def spread(self) -> float | None:
        """Standard deviation of the trial means: repeatability; None for one."""
        return float(self.means.std(ddof=1)) if self.means.size > 1 else None

    @property
    def is_significant(self) -> bool:
        """Whether the slope exceeds two of its standard errors."""
        if self.slope is None or self.slope_error is None:
            return False
        return abs(self.slope) > SIGNIFICANT * self.slope_error


def trends_of(result: TerrainResult) -> dict[str, Trend]:
    """Return the trends of mean F_t, mean F_n and their ratio over the trials."""
    kept = [(k + 1, trial) for k, trial in enumerate(result.trials) if trial.kept]
    return {name: _trend(kept, measure) for name, measure in _MEASURES.items()}


def fit_trend(trials: Array, means: Array) -> Trend:
    """Return the least-squares line through `means` over `trials`, shapes (n,).

    The slope's standard error is s / sqrt(sum (k - mean k)^2), s^2 from the residual
    with n - 2 degrees of freedom.
    """
    if means.size < 3:
        start = float(means.mean()) if means.size else float("nan")
        return Trend(trials, means, None, None, start)
    centred = trials - trials.mean()
    width = float(centred @ centred)
    slope = float(centred @ means) / width
    start = float(means.mean()) - slope * float(trials.mean())
    residual = means - start - slope * trials
    variance = float(residual @ residual) / (means.size - 2)
    return Trend(trials, means, slope, float(np.sqrt(variance / width)), start)


def _trend(
    kept: Sequence[tuple[int, PreparedTrial]], measure: Callable[[PreparedTrial], float]
) -> Trend:
    numbers = np.array([float(number) for number, _ in kept])
    return fit_trend(numbers, np.array([measure(trial) for _, trial in kept]))


def _ratio(trial: PreparedTrial) -> float:
    # a ratio of means: single samples may have F_n near zero
    load = float(trial.F_n.mean())
    return float(trial.F_t.mean()) / load if load > 0 else float("nan")


_MEASURES: Mapping[str, Callable[[PreparedTrial], float]] = {
    MEAN_FORCE: lambda trial: float(trial.F_t.mean()),
    MEAN_LOAD: lambda trial: float(trial.F_n.mean()),
    TRACTION_RATIO: _ratio,
}


def ratios_of(result: TerrainResult) -> Array:
    """Return F_t/F_n of the trials of a terrain, the ratio of the means of each."""
    ratios = np.array([_ratio(trial) for trial in result.trials if trial.kept])
    return ratios[np.isfinite(ratios)]


def traction_ratio(result: TerrainResult) -> str:
    """Return F_t/F_n of a terrain as text: mean of its trials ± their deviation.

    Of a trial it is the ratio of its means. A dash where there is none.
    """
    ratios = ratios_of(result)
    if not ratios.size:
        return "–"
    if ratios.size == 1:
        return f"{ratios[0]:.2f}"
    return f"{ratios.mean():.2f} ± {ratios.std(ddof=1):.2f}"


SHARES = (0.05, 0.5, 0.95)  # quantiles of the residual that are shown
_BINS = 10
_FEWEST = 20  # residuals of a bin that quantiles are taken of


@dataclass(frozen=True, slots=True)
class ResidualBand:
    """Quantiles of measured minus predicted F_t in bins of velocity.

    Attributes:
        v: middle of every bin [m/s], shape (k,).
        quantiles: 5 %, median and 95 % of the residual [N], shape (3, k).
        bias: mean residual over all samples [N].
        sd: their standard deviation [N].
        samples: number of residuals.
        correlation: of residuals one kept sample apart.
        time: integrated autocorrelation time [kept samples].
    """

    v: Array
    quantiles: Array
    bias: float
    sd: float
    samples: int
    correlation: float
    time: float

    @property
    def independent(self) -> float:
        """Number of independent samples that the residuals are worth."""
        return self.samples / self.time


def residual_band(result: TerrainResult, model: str) -> ResidualBand | None:
    """Return the held-out residuals of a model; None without a fold that has it."""
    residual = held_out_residual(result, model)
    if residual.size == 0:
        return None
    v = SampleTable.of(held_out_trials(result, model)).v_t
    edges = np.linspace(v.min(), v.max(), _BINS + 1)
    bin_index = np.clip(np.searchsorted(edges, v, "right") - 1, 0, _BINS - 1)
    full = [k for k in range(_BINS) if np.count_nonzero(bin_index == k) >= _FEWEST]
    return ResidualBand(
        v=np.array([0.5 * (edges[k] + edges[k + 1]) for k in full]),
        quantiles=np.array(
            [np.quantile(residual[bin_index == k], SHARES) for k in full]
        )
        .reshape(-1, len(SHARES))
        .T,
        bias=float(residual.mean()),
        sd=float(residual.std()),
        samples=residual.size,
        correlation=_neighbours(residual),
        time=correlation_samples(residual),
    )


def held_out_trials(result: TerrainResult, model: str) -> list[PreparedTrial]:
    """Return the trials that a fold of the model was tested on, in its order."""
    return [result.trials[k] for k, _ in result.left_out(model)]


def held_out_residual(result: TerrainResult, model: str) -> Array:
    """Return measured minus predicted F_t [N] of all trials left out, shape (n,)."""
    rests = [
        trial.F_t - fold.model.mean(trial.F_n, trial.v_t, trial.further)
        for k, fold in result.left_out(model)
        for trial in [result.trials[k]]
    ]
    return np.concatenate([np.zeros(0), *rests])


def explained_share(result: TerrainResult, model: str) -> float | None:
    """Return R^2 on trials left out: the share of F_t's variance that is predicted."""
    rest = held_out_residual(result, model)
    F_t = SampleTable.of(held_out_trials(result, model)).F_t
    power = float(((F_t - F_t.mean()) ** 2).sum()) if F_t.size else 0.0
    return 1.0 - float((rest**2).sum()) / power if power else None


def _neighbours(residual: Array) -> float:
    """Return the correlation of values (n,) with those one row on; 0 if all agree."""
    centred = residual - residual.mean()
    power = float(centred @ centred)
    return float(centred[1:] @ centred[:-1]) / power if power else 0.0


@dataclass(frozen=True, slots=True)
class NoiseSummary:
    """Constant noise beside the noise that was chosen, on trials left out.

    Attributes:
        terrain: its terrain.
        counts: folds that chose each noise, by its name.
        before: NLPD with constant noise [nat], mean over trials.
        after: NLPD with the chosen noise.
        paired: the second minus the first, trial by trial.
    """

    terrain: str
    counts: dict[str, int]
    before: float
    after: float
    paired: PairedComparison


def noise_summaries(study: Study) -> list[NoiseSummary]:
    """Return one summary per terrain that has both models; none if not fitted."""
    summaries = (_summary(result) for result in study.terrains.values())
    return [summary for summary in summaries if summary is not None]


def _summary(result: TerrainResult) -> NoiseSummary | None:
    before, after = (result.scores(model, "nlpd") for model in (GP_SE, GP_SE_NOISE))
    paired, means = compare(before, after), (mean_of(before), mean_of(after))
    if paired is None or means[0] is None or means[1] is None:
        return None
    fitted = [fold.model for fold in result.models(GP_SE_NOISE)]
    chosen = [
        model.choice.chosen
        for model in fitted
        if isinstance(model, GpModel) and model.choice is not None
    ]
    counts = {str(name): chosen.count(name) for name in NAMES}
    return NoiseSummary(result.terrain, counts, means[0], means[1], paired)
