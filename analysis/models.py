"""The models of a study by name, each fitted to the same rows."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, Protocol

import numpy as np

from analysis.gp import GaussianProcess, fit_gp
from analysis.metrics import Prediction
from analysis.prepare import PreparedTrial
from analysis.series import Array, Indices
from analysis.tustin import TustinBounds, TustinFit, fit_tustin, predict

TUSTIN = "tustin"
GP_SE = "gp_se"
TITLES = {TUSTIN: "Tustin", GP_SE: "GP (SE)"}


@dataclass(frozen=True, slots=True)
class Rows:
    """Kept samples of one or more trials.

    Attributes:
        F_n: normal force [N], shape (n,).
        v_t: slip velocity [m/s], shape (n,).
        F_t: traction force [N], shape (n,).
    """

    F_n: Array
    v_t: Array
    F_t: Array

    @classmethod
    def of(cls, trials: Sequence[PreparedTrial]) -> "Rows":
        """Return the kept samples of `trials`, one after the other."""
        empty = np.zeros(0)
        return cls(
            F_n=np.concatenate([empty, *(trial.F_n for trial in trials)]),
            v_t=np.concatenate([empty, *(trial.v_t for trial in trials)]),
            F_t=np.concatenate([empty, *(trial.F_t for trial in trials)]),
        )

    @property
    def count(self) -> int:
        """Number of rows."""
        return int(self.F_t.size)

    def take(self, indices: Indices) -> "Rows":
        """Return the rows at `indices`."""
        return Rows(self.F_n[indices], self.v_t[indices], self.F_t[indices])


@dataclass(frozen=True, slots=True)
class FitOptions:
    """How models are fitted.

    Attributes:
        bounds: box of the Tustin fit.
        gp_points: number of training rows of a Gaussian process.
        seed: seed of the choice of those rows.
    """

    bounds: TustinBounds = field(default_factory=TustinBounds)
    gp_points: int = 300
    seed: int = 0


class FittedModel(Protocol):
    """A model of F_t over (F_n, v_t), fitted."""

    @property
    def flags(self) -> tuple[str, ...]:
        """What a reader must know before believing its parameters."""
        ...

    def mean(self, F_n: Array, v_t: Array) -> Array:
        """Return the predicted F_t [N], shape (n,)."""
        ...

    def predict(self, F_n: Array, v_t: Array) -> Prediction:
        """Return the predicted F_t and its standard deviation [N], shape (n,)."""
        ...

    def describe(self) -> dict[str, Any]:
        """Return parameters and record of the fit as plain values."""
        ...


@dataclass(frozen=True, slots=True)
class TustinModel:
    """The Tustin curve with the constant spread of its residual."""

    fit: TustinFit

    @property
    def flags(self) -> tuple[str, ...]:
        """Flags of the fit."""
        return self.fit.flags

    def mean(self, F_n: Array, v_t: Array) -> Array:
        """Return F_t [N] by eq. (1)."""
        return predict(self.fit.parameters, F_n, v_t)

    def predict(self, F_n: Array, v_t: Array) -> Prediction:
        """Return the curve and the residual's standard deviation [N]."""
        mean = self.mean(F_n, v_t)
        return Prediction(mean, np.full(mean.shape, self.fit.residual_sd))

    def describe(self) -> dict[str, Any]:
        """Return the five parameters."""
        return asdict(self.fit.parameters)


@dataclass(frozen=True, slots=True)
class GpModel:
    """A Gaussian process over (F_n, v_t)."""

    process: GaussianProcess

    @property
    def flags(self) -> tuple[str, ...]:
        """Hyperparameters at the edge of the search; a long length = input unused."""
        jitter = ("jitter added",) if self.process.jitter else ()
        return tuple(f"{name} at bound" for name in self.process.at_bound) + jitter

    def mean(self, F_n: Array, v_t: Array) -> Array:
        """Return the predictive mean [N]."""
        return self.process.mean(np.column_stack([F_n, v_t]))

    def predict(self, F_n: Array, v_t: Array) -> Prediction:
        """Return the predictive mean and standard deviation [N], noise included."""
        mean, variance = self.process.predict(np.column_stack([F_n, v_t]))
        return Prediction(mean, np.sqrt(variance))

    def describe(self) -> dict[str, Any]:
        """Return hyperparameters, likelihood, starts, jitter and standardisation."""
        gp = self.process
        names = (*gp.kernel.names, *gp.noise.names)
        return {
            "theta": dict(zip(names, gp.theta.tolist(), strict=True)),
            "lml": gp.lml,
            "starts": [{"theta": list(s.theta), "lml": s.lml} for s in gp.starts],
            "jitter": gp.jitter,
            "centre": gp.centre.tolist(),
            "scale": gp.scale.tolist(),
            "offset": gp.offset,
        }


Fitter = Callable[[Rows, Rows, FitOptions], FittedModel]


def _fit_tustin(training: Rows, _subset: Rows, options: FitOptions) -> FittedModel:
    fit = fit_tustin(training.F_n, training.v_t, training.F_t, options.bounds)
    return TustinModel(fit)


def _fit_gp_se(_training: Rows, subset: Rows, _options: FitOptions) -> FittedModel:
    return GpModel(fit_gp(np.column_stack([subset.F_n, subset.v_t]), subset.F_t))


# (all training rows, the rows chosen for Gaussian processes, options) -> model
FITTERS: Mapping[str, Fitter] = {TUSTIN: _fit_tustin, GP_SE: _fit_gp_se}
