from . import kernels, noise, trial_noise
from .arcsine import Arcsine
from .kernels import Kernel, SquaredExponential
from .noise import ConstantNoise, LogLinearNoise
from .regression import GaussianProcess, fit_gp, refit_gp, without_idle_inputs
from .search import Start
from .trial_noise import TrialNoise, TrialRows

__all__ = [
    "Arcsine",
    "ConstantNoise",
    "GaussianProcess",
    "Kernel",
    "LogLinearNoise",
    "SquaredExponential",
    "Start",
    "TrialNoise",
    "TrialRows",
    "fit_gp",
    "kernels",
    "noise",
    "refit_gp",
    "trial_noise",
    "without_idle_inputs",
]
