"""Models of a study by name, all fitted to the same rows.

The five of Fig. 9 are the default; others go beyond the paper: a Gaussian process whose
noise model is chosen per fold, and processes with predictive bands for a new trial.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Protocol

import numpy as np

from acquisition.errors import SettingsError
from analysis.data.samples import TrainingSet
from analysis.data.series import Array
from analysis.gp.arcsine import Arcsine
from analysis.gp.kernels import Kernel, SquaredExponential
from analysis.gp.noise import LogLinearNoise
from analysis.gp.refit import refit_gp
from analysis.gp.regression import GaussianProcess, fit_gp
from analysis.study.distribution import Distribution
from analysis.study.metrics import Prediction
from analysis.study.new_trial import NewTrialFit, NewTrialModel
from analysis.study.noise_selection import NoiseChoice, TailedNoise, choose_noise
from analysis.tustin.model import TustinBounds, TustinFit, TustinForm, fit_tustin

TUSTIN = "tustin"
GP_SE = "gp_se"
GP_NN = "gp_nn"
GP_SE_TUSTIN = "gp_se_tustin"
GP_NN_TUSTIN = "gp_nn_tustin"
GP_SE_NOISE = "gp_se_noise"
GP_SE_TRIAL = "gp_se_trial"
GP_NN_TRIAL = "gp_nn_trial"
GP_SE_TUSTIN_TRIAL = "gp_se_tustin_trial"
GP_NN_TUSTIN_TRIAL = "gp_nn_tustin_trial"
PAPER_MODELS = (TUSTIN, GP_SE, GP_NN, GP_SE_TUSTIN, GP_NN_TUSTIN)  # Fig. 9
REPORTED = (*PAPER_MODELS, GP_SE_NOISE, GP_SE_TRIAL)  # by default


@dataclass(frozen=True, slots=True)
class FitOptions:
    """Options of the model fits.

    Attributes:
        bounds: box of the Tustin fit.
        gp_points: number of training rows of a Gaussian process.
        seed: random seed for the choice of those rows.
        models: names of the models, by default the five of Fig. 9.
        form: variant and loss of the Tustin fit.
        is_nn_as_printed: eq. (5) as printed, c = 0, for the NN kernel.
        draws: bootstrap draws for the intervals of the Tustin parameters and of the
            variance components (100 at most); 0 for none.

    Raises:
        SettingsError: unknown model, or fewer than one point.
    """

    bounds: TustinBounds = field(default_factory=TustinBounds)
    gp_points: int = 300
    seed: int = 0
    models: tuple[str, ...] = PAPER_MODELS
    form: TustinForm = field(default_factory=TustinForm)
    is_nn_as_printed: bool = False
    draws: int = 200

    def __post_init__(self) -> None:
        unknown = [name for name in self.models if name not in MODELS]
        if unknown or self.gp_points < 1:
            raise SettingsError(
                f"No study of {', '.join(unknown) or 'the models'} with "
                f"{self.gp_points} points.",
                hint=f"The models are {', '.join(MODELS)}; give at least one point.",
            )


class FittedModel(Protocol):
    """Fitted model of F_t over (F_n, v_t)."""

    @property
    def flags(self) -> tuple[str, ...]:
        """Warnings about its parameters."""
        ...

    def mean(self, F_n: Array, v_t: Array, further: Array | None = None) -> Array:
        """Return the predicted F_t [N], shape (n,).

        Args:
            F_n: normal force [N], shape (n,).
            v_t: slip velocity [m/s], shape (n,).
            further: other inputs of the model, shape (n, k); None = their means.
        """
        ...

    def predict(
        self, F_n: Array, v_t: Array, further: Array | None = None
    ) -> Distribution:
        """Return the predictive distribution of F_t [N] at n points; see `mean`."""
        ...

    def describe(self) -> dict[str, Any]:
        """Return parameters and record of the fit as plain values."""
        ...


@dataclass(frozen=True, slots=True)
class TustinModel:
    """Tustin curve with a constant residual standard deviation."""

    fit: TustinFit

    @property
    def flags(self) -> tuple[str, ...]:
        """Flags of the fit."""
        return self.fit.flags

    def mean(self, F_n: Array, v_t: Array, further: Array | None = None) -> Array:
        """Return F_t [N] by eq. (1)."""
        return self.fit.mean(F_n, v_t)

    def predict(
        self, F_n: Array, v_t: Array, further: Array | None = None
    ) -> Prediction:
        """Return the curve and the residual's standard deviation [N]."""
        mean = self.mean(F_n, v_t, further)
        return Prediction(mean, np.full(mean.shape, self.fit.residual_sd))

    def describe(self) -> dict[str, Any]:
        """Return the five parameters."""
        return asdict(self.fit.parameters)


@dataclass(frozen=True, slots=True)
class GpModel:
    """Gaussian process over (F_n, v_t), with or without a Tustin mean function.

    Attributes:
        process: process of F_t, or of its residual about the curve.
        curve: Tustin fit that is its mean function.
        tails: Student's t noise instead of normal noise.
        choice: record of the choice of noise.
    """

    process: GaussianProcess
    curve: TustinFit | None = None
    tails: TailedNoise | None = None
    choice: NoiseChoice | None = None

    @property
    def flags(self) -> tuple[str, ...]:
        """Hyperparameters at a bound of the search; a long length = input unused."""
        jitter = ("jitter added",) if self.process.jitter else ()
        return tuple(f"{name} at bound" for name in self.process.at_bound) + jitter

    def mean(self, F_n: Array, v_t: Array, further: Array | None = None) -> Array:
        """Return the predictive mean [N]."""
        mean = self.process.mean(self.process.at(F_n, v_t, further))
        return self._plus_curve(mean, F_n, v_t)

    def predict(
        self, F_n: Array, v_t: Array, further: Array | None = None
    ) -> Prediction:
        """Return the predictive mean and standard deviation [N], noise included."""
        mean, variance = self.process.predict(self.process.at(F_n, v_t, further))
        normal = Prediction(self._plus_curve(mean, F_n, v_t), np.sqrt(variance))
        return normal if self.tails is None else self.tails.applied_to(normal)

    def describe(self) -> dict[str, Any]:
        """Return hyperparameters, likelihood, starts, jitter and standardisation."""
        return self.process.describe() | {
            "curve": None if self.curve is None else asdict(self.curve.parameters),
            "tails": None if self.tails is None else self.tails._asdict(),
            "noise": None if self.choice is None else self.choice._asdict(),
        }

    def _plus_curve(self, mean: Array, F_n: Array, v_t: Array) -> Array:
        return mean if self.curve is None else mean + self.curve.mean(F_n, v_t)


class ModelFitter:
    """Fits models by name to one training set and shares common parts.

    Args:
        training: training data.
        options: options of the fits.
    """

    def __init__(self, training: TrainingSet, options: FitOptions) -> None:
        self.training, self.options = training, options
        self._curve: TustinFit | None = None
        self._processes: dict[tuple[Kernel, bool], GpModel] = {}

    def curve(self) -> TustinFit:
        """Return the Tustin fit to all training rows; computed once.

        Raises:
            SettingsError: fewer than 20 rows.
        """
        if self._curve is None:
            rows, options = self.training.rows, self.options
            self._curve = fit_tustin(
                rows.F_n, rows.v_t, rows.F_t, options.bounds, options.form
            )
        return self._curve

    def fit(self, name: str) -> FittedModel:
        """Fit the model `name` to the training rows.

        Raises:
            SettingsError: no such model, or it cannot be fitted to these rows.
        """
        if name not in MODELS:
            raise SettingsError(
                f"There is no model {name!r}.",
                hint=f"The models are {', '.join(MODELS)}.",
            )
        return MODELS[name].fit(self)

    def gp(self, kernel: Kernel, *, is_around_tustin: bool = False) -> GpModel:
        """Fit a Gaussian process with constant noise to the chosen rows; once each.

        Args:
            kernel: covariance function.
            is_around_tustin: the mean function is the Tustin curve, fitted to all rows,
                instead of a constant.
        """
        key = kernel, is_around_tustin
        if key not in self._processes:
            subset = self.training.subset
            curve = self.curve() if is_around_tustin else None
            outputs = subset.F_t
            if curve is not None:
                outputs = outputs - curve.mean(subset.F_n, subset.v_t)
            process = fit_gp(subset.inputs, outputs, kernel, is_centred=curve is None)
            self._processes[key] = GpModel(process, curve)
        return self._processes[key]

    def gp_with_chosen_noise(self) -> GpModel:
        """Fit a Gaussian process whose noise model is chosen by the training trials."""
        training, constant = self.training, self.gp(self.se_kernel)
        outputs = training.subset.F_t
        changing = refit_gp(
            constant.process, outputs, noise=LogLinearNoise(self._dimensions)
        )
        choice = choose_noise(training, constant.process, changing, self.options.seed)
        if choice.chosen == "constant":
            return replace(constant, choice=choice)
        tails = (
            TailedNoise.of(changing, training) if choice.chosen == "student" else None
        )
        return GpModel(changing, tails=tails, choice=choice)

    def new_trial(
        self, kernel: Kernel, *, is_around_tustin: bool = False
    ) -> NewTrialModel:
        """Fit the model of a new trial with a Tustin or constant mean function."""
        start = self.gp(kernel, is_around_tustin=is_around_tustin)
        return NewTrialFit(self.training, start.curve).fit(start.process)

    @property
    def se_kernel(self) -> SquaredExponential:
        """Squared exponential kernel of eq. (4), one length per input."""
        return SquaredExponential(self._dimensions)

    @property
    def nn_kernel(self) -> Arcsine:
        """Neural-network kernel of eq. (5); as printed if the options say so."""
        return Arcsine(self._dimensions, as_printed=self.options.is_nn_as_printed)

    @property
    def _dimensions(self) -> int:
        further = self.training.rows.further
        return 2 if further is None else 2 + further.shape[1]


@dataclass(frozen=True, slots=True)
class ModelKind:
    """A kind of model in the registry.

    Attributes:
        title: title in figures and tables.
        fit: function that fits it to the training rows of a `ModelFitter`.
        is_compared: included in the common tables and figures, without its own.
        is_of_new_trial: its bands hold for a new trial.
    """

    title: str
    fit: Callable[[ModelFitter], FittedModel]
    is_compared: bool = True
    is_of_new_trial: bool = False


# The registry of models: titles, command options, cross-validation, tables, figures and
# cached results all follow from an entry here.
MODELS: Mapping[str, ModelKind] = {
    TUSTIN: ModelKind("Tustin", lambda fitter: TustinModel(fitter.curve())),
    GP_SE: ModelKind("GP (SE)", lambda fitter: fitter.gp(fitter.se_kernel)),
    GP_NN: ModelKind("GP (NN)", lambda fitter: fitter.gp(fitter.nn_kernel)),
    GP_SE_TUSTIN: ModelKind(
        "GP (SE, Tustin mean)",
        lambda fitter: fitter.gp(fitter.se_kernel, is_around_tustin=True),
    ),
    GP_NN_TUSTIN: ModelKind(
        "GP (NN, Tustin mean)",
        lambda fitter: fitter.gp(fitter.nn_kernel, is_around_tustin=True),
    ),
    GP_SE_NOISE: ModelKind(
        "GP (SE, noise chosen)", ModelFitter.gp_with_chosen_noise, is_compared=False
    ),
    GP_SE_TRIAL: ModelKind(
        "GP (SE, new trial)",
        lambda fitter: fitter.new_trial(fitter.se_kernel),
        is_compared=False,
        is_of_new_trial=True,
    ),
    GP_NN_TRIAL: ModelKind(
        "GP (NN, new trial)",
        lambda fitter: fitter.new_trial(fitter.nn_kernel),
        is_compared=False,
        is_of_new_trial=True,
    ),
    GP_SE_TUSTIN_TRIAL: ModelKind(
        "GP (SE, Tustin mean, new trial)",
        lambda fitter: fitter.new_trial(fitter.se_kernel, is_around_tustin=True),
        is_compared=False,
        is_of_new_trial=True,
    ),
    GP_NN_TUSTIN_TRIAL: ModelKind(
        "GP (NN, Tustin mean, new trial)",
        lambda fitter: fitter.new_trial(fitter.nn_kernel, is_around_tustin=True),
        is_compared=False,
        is_of_new_trial=True,
    ),
}
TITLES = {name: kind.title for name, kind in MODELS.items()}
NEW_TRIAL = frozenset(name for name, kind in MODELS.items() if kind.is_of_new_trial)


def compared(models: Sequence[str]) -> tuple[str, ...]:
    """Return those of `models` that are compared in common tables and figures."""
    return tuple(name for name in models if MODELS[name].is_compared)


def parse_models(text: str) -> tuple[str, ...]:
    """Parse a list of models such as "tustin,gp_se".

    Raises:
        SettingsError: a model does not exist or is named twice.
    """
    names = tuple(name.strip() for name in text.split(",") if name.strip())
    unknown = [name for name in names if name not in MODELS]
    if unknown or not names or len(set(names)) < len(names):
        what = f"no model {', '.join(unknown)}" if unknown else "not a list of models"
        raise SettingsError(
            f"--models {text}: {what}.",
            hint=f"Name each once, with commas between: {', '.join(MODELS)}.",
        )
    return names
