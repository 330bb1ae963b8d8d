"""Models whose bands hold for a new trial: with an effect of the trial, and skew.

Three families compete, each with a level of its own in every trial: normal noise, noise
that changes with the inputs, and normal noise around a warped force z = c log(y + c).
The choice is made among the training trials only, by the log density (of y) of each of
them left out in turn: the hyperparameters stay, its rows are taken out and the rest is
factorised again. Another family than the normal one must be better by one standard
error over the trials and by 0.05 nat. So must a `ShapeMap` on top of the chosen one
be, by one standard error; every trial is scored by the shape of the others.

The function comes from at most 30 trials, a row of each from stretches of equal length:
more rows of a process cost the cube of their number, and a trial of which it has a row
or none shows no level. The level of a trial comes from the residuals of all rows of all
trials (`analysis.gp.trial_level`), and so does the spread within a trial. Only a level
in proportion to F_n is left to the likelihood.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from analysis.data.samples import TrainingSet
from analysis.data.series import Array, Indices
from analysis.gp.kernels import Kernel
from analysis.gp.noise import ConstantNoise, LogLinearNoise
from analysis.gp.refit import refit_gp
from analysis.gp.regression import GaussianProcess, LeaveOut, fit_gp
from analysis.gp.trial_level import TrialLevels, TrialResiduals, levels_of
from analysis.gp.trial_noise import TrialNoise, TrialRows
from analysis.study.distribution import FEWEST, NewTrialPrediction
from analysis.study.metrics import clearly_best
from analysis.study.skew import (
    ShapeMap,
    bends_for,
    choose_shape,
    deepest,
    log_warp_slope,
    unwarped,
    warped,
)
from analysis.tustin.model import TustinFit

NORMAL, LOGLINEAR, WARPED = "normal", "loglinear", "log warp"
FAMILIES = (NORMAL, LOGLINEAR, WARPED)
LEVEL, RATIO, BOTH = "constant", "proportional", "both"
EFFECTS = (LEVEL, RATIO, BOTH)

LEAST_GAIN = 0.05  # nat; stones gain 0.06 to 0.28 by the warp, plates up to 0.04
_BENDS = (1.0, 3.0, 9.0)  # N, c of the warp
MOST_TRIALS = 30  # that the function is fitted to
UNSEEN = 2  # rows for each that the function is fitted to, to judge its residuals
_STEP = 0.01  # s of motion from one kept sample to the next
_THIN = 5  # of the rows of a trial left out every fifth is scored


class FamilyChoice(NamedTuple):
    """The family chosen for a training set, and why.

    Attributes:
        chosen: its name.
        nlpd: mean negative log density of training trials left out, by family.
        shape_gain: by how much a shape on top raised it [nat].
        clipped: chosen rows below -0.95 c, where the warp has an end.
    """

    chosen: str
    nlpd: dict[str, float]
    shape_gain: float
    clipped: int


class LevelSpread(NamedTuple):
    """How far z of trials differs, by the residuals of all of them.

    Attributes:
        between: standard deviation of the level of a trial.
        error: its standard error; None where trials are too short to say.
        other: the same by the other of the two ways; None where there is none.
        is_by_moments: moments gave it, else the restricted likelihood.
        within: variance of rows within a trial over what the process says of them.
    """

    between: float
    error: float | None
    other: float | None
    is_by_moments: bool
    within: float


@dataclass(frozen=True, slots=True)
class NewTrialModel:
    """A model of F_t over (F_n, v_t) that predicts a trial it has not seen.

    Attributes:
        process: the process of z with the trial's effect in its noise.
        curve: Tustin fit that is its mean function.
        trials: number of trials it was fitted to.
        c: of the warp z = c log(y + c) [N]; None for z = y.
        shape: of the distribution, where it was worth one.
        choice: how the family was chosen.
        spread: how far trials differ; None where the likelihood of the process says it.
    """

    process: GaussianProcess
    curve: TustinFit | None
    trials: int
    c: float | None
    shape: ShapeMap | None
    choice: FamilyChoice
    spread: LevelSpread | None = None

    @property
    def flags(self) -> tuple[str, ...]:
        """Hyperparameters at the edge of the search, and what was clipped."""
        jitter = ("jitter added",) if self.process.jitter else ()
        clipped = ("forces clipped by the warp",) if self.choice.clipped else ()
        at_bound = (f"{name} at bound" for name in self.process.at_bound)
        return (*at_bound, *jitter, *clipped)

    def mean(self, F_n: Array, v_t: Array, further: Array | None = None) -> Array:
        """Return the median [N], the forecast of the smallest absolute error."""
        if self.shape is not None:
            return self.predict(F_n, v_t, further).point
        inputs = self.process.at(F_n, v_t, further)
        z = self.process.mean(inputs) + _curve(self.curve, inputs, self.c)
        return unwarped(z, self.c)

    def predict(
        self, F_n: Array, v_t: Array, further: Array | None = None
    ) -> NewTrialPrediction:
        """Return the distribution of measurements of a new trial."""
        inputs = self.process.at(F_n, v_t, further)
        mean, variance = self.process.predict(inputs)
        prediction = _prediction(
            self.process, inputs, mean, variance, self.trials, self.curve, self.c
        )
        if self.spread is not None:
            noise = _noise_within(self.process, inputs)
            prediction = replace(
                prediction,
                within=prediction.within + (self.spread.within - 1.0) * noise,
                between=np.full(mean.shape, self.spread.between**2),
            )
        return replace(prediction, shape=self.shape)

    def describe(self) -> dict[str, Any]:
        """Return hyperparameters, likelihood, starts, family and standardisation."""
        return self.process.describe() | {
            "curve": None if self.curve is None else asdict(self.curve.parameters),
            "trials": self.trials,
            "c": self.c,
            "shape": None if self.shape is None else self.shape._asdict(),
            "family": self.choice._asdict(),
            "spread": None if self.spread is None else self.spread._asdict(),
        }


class _Candidate(NamedTuple):
    """One family, fitted.

    Attributes:
        family: its name.
        process: of z.
        c: of its warp [N], None without.
    """

    family: str
    process: GaussianProcess
    c: float | None


class NewTrialFit:
    """Fits the families to one training set.

    Args:
        training: rows of the training trials.
        curve: Tustin fit that is the mean function; None for a constant.
        effect: what a trial adds: "constant", "proportional" to F_n, or "both".
        families: that compete, the normal one among them; it alone gets no shape.
    """

    def __init__(
        self,
        training: TrainingSet,
        curve: TustinFit | None,
        effect: str = LEVEL,
        families: Sequence[str] = FAMILIES,
    ) -> None:
        self._training, self._curve, self._effect = training, curve, effect
        self._families = families
        self._chosen = spread_rows(training.lengths, training.chosen.size)
        self._rows = training.rows.take(self._chosen)
        self._trial = training.trial_of()
        label = self._trial[self._chosen]
        self._trials = TrialRows(label)
        self._left_out = [
            np.flatnonzero(self._trial == k)[::_THIN] for k in np.unique(label)
        ]

    def fit(self, kernel: Kernel) -> NewTrialModel:
        """Return the family that predicts training trials best when left out.

        Raises:
            SettingsError: fewer than 20 rows, or outputs that do not vary.
        """
        candidates = self._candidates(kernel)
        scores = [self._held_out(candidate) for candidate in candidates]
        nlpd = np.array([[-part.mean() for part, _ in each] for each in scores]).T
        best = clearly_best(nlpd, LEAST_GAIN)
        chosen = candidates[best]
        shape, gain = None, 0.0
        if len(candidates) > 1:
            shape, gain = choose_shape([x for _, x in scores[best]])
        choice = FamilyChoice(
            chosen.family,
            {c.family: float(m) for c, m in zip(candidates, nlpd.mean(0), strict=True)},
            gain,
            int(np.count_nonzero(self._rows.F_t < deepest(chosen.c))),
        )
        process, spread = self._with_levels(chosen)
        count = len(self._training.lengths)
        return NewTrialModel(
            process, self._curve, count, chosen.c, shape, choice, spread
        )

    def _with_levels(
        self, candidate: _Candidate
    ) -> tuple[GaussianProcess, LevelSpread | None]:
        """Return the process around the mean of all trials, and how these differ."""
        process, noise = candidate.process, candidate.process.noise
        if not isinstance(noise, TrialNoise) or noise.has_ratio or not noise.has_level:
            return process, None
        rows = self._training.rows
        if rows.count < UNSEEN * self._chosen.size:
            return (
                process,
                None,
            )  # residuals of rows that it was fitted to are too small
        residual = self._outputs(np.arange(rows.count), candidate.c)
        residual -= process.mean(rows.inputs)
        parts = np.split(residual, np.cumsum(self._training.lengths)[:-1])
        residuals = TrialResiduals(
            [(_STEP * np.arange(float(part.size)), part) for part in parts]
        )
        levels = levels_of(residuals)
        usual = float(_noise_within(process, self._rows.inputs).mean())
        spread = _spread_of(levels, usual)
        return replace(process, offset=process.offset + levels.mean), spread

    def _candidates(self, kernel: Kernel) -> list[_Candidate]:
        outputs = self._outputs(self._chosen, None)
        normal = fit_gp(
            self._rows.inputs,
            outputs,
            kernel,
            self._noise(ConstantNoise()),
            is_centred=self._curve is None,
            trials=self._trials,
        )
        fitted = [_Candidate(NORMAL, normal, None)]
        if len(self._left_out) < 2:
            return fitted
        if LOGLINEAR in self._families:
            noise = self._noise(LogLinearNoise(self._rows.inputs.shape[1]))
            changing = refit_gp(normal, outputs, noise=noise)
            fitted.append(_Candidate(LOGLINEAR, changing, None))
        bends = bends_for(self._rows.F_t, _BENDS)
        if WARPED in self._families and bends:
            fitted.append(self._bent(normal, bends))
        return fitted

    def _bent(self, normal: GaussianProcess, bends: Sequence[float]) -> _Candidate:
        """Return the likeliest warp, by the likelihood of z and its Jacobian."""
        sd = float(self._outputs(self._chosen, None).std())

        def bent(c: float) -> tuple[float, _Candidate]:
            z = self._outputs(self._chosen, c)
            process = refit_gp(normal, z, float(z.std()) / sd)
            lml = process.lml + float(log_warp_slope(self._rows.F_t, c).sum())
            return lml, _Candidate(WARPED, process, c)

        best = max(map(bent, bends), key=lambda pair: pair[0])[1]
        z, process = self._outputs(self._chosen, best.c), best.process
        # the same noise as another one: other tops are searched for, too
        return best._replace(process=refit_gp(process, z, noise=process.noise))

    def _noise(self, within: ConstantNoise | LogLinearNoise) -> TrialNoise:
        load = self._rows.F_n
        usual = max(float(np.abs(load).mean()), 1e-9)
        return TrialNoise(
            within,
            has_level=self._effect != RATIO and len(self._left_out) > 1,
            has_ratio=self._effect != LEVEL and len(self._left_out) > 1,
            load=(float(load.mean()) / usual, float(load.std()) / usual),
        )

    def _outputs(self, rows: Indices, c: float | None) -> Array:
        taken = self._training.rows.take(rows)
        return warped(taken.F_t, c) - _curve(self._curve, taken.inputs, c)

    def _held_out(self, candidate: _Candidate) -> list[tuple[Array, Array]]:
        """Return log density and normal score of rows of every trial left out."""
        if len(self._left_out) < 2:
            return [(np.zeros(1), np.zeros(1))]
        process = candidate.process
        without, count = LeaveOut(process), len(self._left_out) - 1
        found = []
        for rows, block in zip(self._left_out, self._trials.blocks(), strict=True):
            tested = self._training.rows.take(rows)
            mean, variance = without.predict(block, tested.inputs)
            made = _prediction(
                process,
                tested.inputs,
                mean,
                variance,
                count,
                self._curve,
                candidate.c,
            )
            found.append((made.log_density(tested.F_t), made.normal_score(tested.F_t)))
        return found


def fit_new_trial(
    training: TrainingSet, kernel: Kernel, curve: TustinFit | None, effect: str
) -> NewTrialModel:
    """Return the model of a new trial; see `NewTrialFit`."""
    return NewTrialFit(training, curve, effect).fit(kernel)


def family_counts(models: Sequence[NewTrialModel]) -> Mapping[str, int]:
    """Return how many models chose each family."""
    chosen = [model.choice.chosen for model in models]
    return {family: chosen.count(family) for family in FAMILIES}


def _spread_trials(count: int) -> Indices:
    """Return at most 30 of so many trials, spread evenly over their order."""
    wanted = min(count, MOST_TRIALS)
    return np.round(np.linspace(0, count - 1, wanted)).astype(int)


def spread_rows(lengths: Sequence[int], count: int) -> Indices:
    """Return about `count` rows of at most 30 trials, one from stretches alike.

    Args:
        lengths: number of rows of every trial, one trial after the other.
        count: of rows that are wanted.
    """
    starts = np.concatenate([[0], np.cumsum(lengths)])
    trials = _spread_trials(len(lengths))
    each = max(count // trials.size, 1)
    middles = (np.arange(each) + 0.5) / each
    rows = [starts[k] + np.floor(middles * lengths[k]).astype(int) for k in trials]
    return np.unique(np.concatenate(rows))


def _spread_of(levels: TrialLevels, usual: float) -> LevelSpread:
    """Return how far trials differ.

    Args:
        levels: of all trials.
        usual: variance of rows within a trial by the process.
    """
    return LevelSpread(
        between=levels.between,
        error=levels.error,
        other=levels.other,
        is_by_moments=levels.is_by_moments,
        within=levels.within**2 / usual,
    )


def _noise_within(process: GaussianProcess, inputs: Array) -> Array:
    """Return the variance of single rows of a trial by a process, shape (n,)."""
    theta = process.theta[len(process.kernel.names) :]
    Z = (inputs - process.centre) / process.scale
    noise = process.noise
    within = noise.variance(theta, Z)
    return (
        within - noise.trial_variance(theta, Z)
        if isinstance(noise, TrialNoise)
        else within
    )


def _prediction(
    process: GaussianProcess,
    inputs: Array,
    mean: Array,
    variance: Array,
    trials: int,
    curve: TustinFit | None,
    c: float | None,
) -> NewTrialPrediction:
    """Return what a process of z says of forces, around a curve, warped with c.

    Args:
        process: of z.
        inputs: where, shape (n, d).
        mean: of z there, shape (n,).
        variance: of z there, noise included, shape (n,).
        trials: number of trials that it was given.
        curve: mean function of the force; None = 0.
        c: of the warp; None = there is none.
    """
    between = np.zeros(mean.shape)
    if isinstance(process.noise, TrialNoise):
        theta = process.theta[len(process.kernel.names) :]
        Z = (inputs - process.centre) / process.scale
        between = process.noise.trial_variance(theta, Z)
    centre, freedom = mean + _curve(curve, inputs, c), max(trials - 1, FEWEST)
    return NewTrialPrediction(centre, variance - between, between, freedom, c)


def _curve(curve: TustinFit | None, inputs: Array, c: float | None) -> Array:
    """Return the mean function of z at (F_n, v_t), shape (n,)."""
    if curve is None:
        return np.zeros(inputs.shape[0])
    return warped(curve.mean(inputs[:, 0], inputs[:, 1]), c)
