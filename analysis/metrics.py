"""How well predictions met measurements."""

from typing import NamedTuple

import numpy as np

from analysis.series import Array

_TWO_SIDED_95 = 1.959963984540054  # standard deviations that hold 95 % of a normal


class Prediction(NamedTuple):
    """A predicted F_t with its uncertainty.

    Attributes:
        mean: predicted F_t [N], shape (n,).
        sd: standard deviation of a measurement around it [N], noise included, (n,).
    """

    mean: Array
    sd: Array


class Score(NamedTuple):
    """Errors of one model on one trial.

    Attributes:
        mae: mean absolute error [N].
        rmse: root mean square error [N].
        coverage95: share of measurements inside the 95 % band [-].
        variance: mean predictive variance, noise included [N^2].
    """

    mae: float
    rmse: float
    coverage95: float
    variance: float


def score(F_t: Array, prediction: Prediction) -> Score:
    """Return the errors of a prediction of F_t [N], shape (n,) with n >= 1."""
    error = np.abs(F_t - prediction.mean)
    return Score(
        mae=float(error.mean()),
        rmse=float(np.sqrt(np.mean(error**2))),
        coverage95=float(np.mean(error <= _TWO_SIDED_95 * prediction.sd)),
        variance=float(np.mean(prediction.sd**2)),
    )


def mean_absolute_error(F_t: Array, mean: Array) -> float:
    """Return the mean absolute error [N] of predicted means."""
    return float(np.mean(np.abs(F_t - mean)))
