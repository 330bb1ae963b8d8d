from . import kernels, noise, trial_noise
from .arcsine import Arcsine
from .ascent import Start
from .ground import Ground, GroundRows
from .hierarchy import (
    GroundPosterior,
    GroundProcess,
    PredictiveProcess,
    in_unit,
    prior_of,
)
from .kernels import Kernel, SquaredExponential
from .likelihood import Likelihood, factorise
from .noise import ConstantNoise, LogLinearNoise
from .refit import refit_gp
from .regression import GaussianProcess, LeaveOut, fit_gp
from .trial_noise import TrialNoise, TrialRows

__all__ = [
    "Arcsine",
    "ConstantNoise",
    "GaussianProcess",
    "Ground",
    "GroundPosterior",
    "GroundProcess",
    "GroundRows",
    "Kernel",
    "LeaveOut",
    "Likelihood",
    "LogLinearNoise",
    "PredictiveProcess",
    "SquaredExponential",
    "Start",
    "TrialNoise",
    "TrialRows",
    "factorise",
    "fit_gp",
    "in_unit",
    "kernels",
    "noise",
    "prior_of",
    "refit_gp",
    "trial_noise",
]
