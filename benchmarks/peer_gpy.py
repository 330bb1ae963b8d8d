"""GPy for comparison: the SE kernel from the same starts, with GPy's own L-BFGS-B."""

import contextlib
import io
import warnings
from collections.abc import Callable, Sequence

import numpy as np


def fitter(X: np.ndarray, y: np.ndarray) -> Callable[[Sequence[np.ndarray]], float]:
    """Return a function that fits from given starts; it returns the best likelihood.

    Raises:
        ImportError: GPy is not installed.
    """
    from GPy.kern import RBF
    from GPy.models import GPRegression

    def optimised(start: np.ndarray) -> float:
        sf, *lengths, sn = np.exp(start)
        kernel = RBF(X.shape[1], sf**2, lengths, ARD=True)
        model = GPRegression(X, y[:, None], kernel, noise_var=sn**2)
        model.optimize("lbfgsb", messages=False)
        return float(model.log_likelihood())

    def fit(starts: Sequence[np.ndarray]) -> float:
        with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
            warnings.simplefilter("ignore")
            return max(optimised(start) for start in starts)

    return fit
