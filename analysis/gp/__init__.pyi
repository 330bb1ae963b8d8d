from . import kernels, noise
from .arcsine import Arcsine
from .kernels import Kernel, SquaredExponential
from .noise import ConstantNoise, LogLinearNoise
from .regression import GaussianProcess, fit_gp
from .search import Start

__all__ = [
    "Arcsine",
    "ConstantNoise",
    "GaussianProcess",
    "Kernel",
    "LogLinearNoise",
    "SquaredExponential",
    "Start",
    "fit_gp",
    "kernels",
    "noise",
]
