"""tinygp for comparison: the SE kernel from the same starts, L-BFGS, jitted gradient.

Compilation is not counted: the first fit is discarded.
"""

from collections.abc import Callable, Sequence

import numpy as np

_METHOD = "L-BFGS-B"


def fitter(X: np.ndarray, y: np.ndarray) -> Callable[[Sequence[np.ndarray]], float]:
    """Return a function that fits from given starts; it returns the best likelihood.

    Raises:
        ImportError: tinygp or jax is not installed.
    """
    import jax
    import jax.numpy as jnp
    from scipy.optimize import minimize
    from tinygp import GaussianProcess, kernels, transforms

    jax.config.update("jax_enable_x64", True)

    def cost(theta):  # noqa: ANN001, ANN202
        size, noise = jnp.exp(2.0 * theta[0]), jnp.exp(2.0 * theta[-1])
        distance = kernels.distance.L2Distance()
        shape = kernels.ExpSquared(distance=distance)
        shape = transforms.Linear(jnp.exp(-theta[1:-1]), shape)
        return -GaussianProcess(size * shape, X, diag=noise).log_probability(y)

    step = jax.jit(jax.value_and_grad(cost))

    def value_and_slope(theta: np.ndarray) -> tuple[float, np.ndarray]:
        value, slope = step(theta)
        return float(value), np.asarray(slope)

    def fit(starts: Sequence[np.ndarray]) -> float:
        fits = (minimize(value_and_slope, s, jac=True, method=_METHOD) for s in starts)
        return -min(float(result.fun) for result in fits)

    return fit
