"""Gaussian process regression: fit of the hyperparameters, and prediction.

Equations 6 and 7 of the traction paper.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from acquisition.errors import SettingsError
from analysis.data.samples import inputs_of
from analysis.data.series import Array
from analysis.gp.kernels import Kernel, SquaredExponential
from analysis.gp.likelihood import Factor, Likelihood, factorise, lapack, split
from analysis.gp.noise import ConstantNoise, Noise
from analysis.gp.search import Start, maximise_posterior, spread
from analysis.gp.trial_noise import TrialRows, shared_over

MINIMUM_ROWS = 20

_BLOCK = 500  # rows predicted at a time, so that their matrix stays in the cache


@dataclass(frozen=True, slots=True)
class GaussianProcess:
    """A fitted Gaussian process on standardised inputs.

    Attributes:
        kernel: covariance function.
        noise: noise of the measurements.
        theta: logarithms of the kernel's, then the noise's hyperparameters.
        X: standardised training inputs, shape (n, d).
        alpha: C^-1 (y - offset), shape (n,).
        offset: subtracted from the training outputs: their mean, or 0.
        centre: mean of the training inputs, shape (d,).
        scale: standard deviation of the training inputs, shape (d,); 1 if constant.
        lml: log marginal likelihood of the training outputs, noise prior included.
        starts: result of every start of the search.
        jitter: added to the diagonal for the factorisation.
        at_bound: hyperparameters at a bound of the search.
        trials: trial of every training row, for noise shared within trials.
    """

    kernel: Kernel
    noise: Noise
    theta: Array
    X: Array
    alpha: Array
    offset: float
    centre: Array
    scale: Array
    lml: float
    starts: tuple[Start, ...]
    jitter: float
    at_bound: tuple[str, ...]
    trials: TrialRows | None = None

    def mean(self, inputs: Array) -> Array:
        """Return the predictive mean at `inputs`, shape (m, d), in y's unit."""
        theta, _ = split(self.kernel, self.theta)
        Z = (inputs - self.centre) / self.scale
        # multiplied as in `predict`, so that both agree to the last digit
        blocks = [
            self.alpha @ self.kernel.matrix(theta, self.X, Z[i : i + _BLOCK])
            for i in range(0, Z.shape[0], _BLOCK)
        ]
        return self.offset + np.concatenate([np.zeros(0), *blocks])

    def at(self, F_n: Array, v_t: Array, further: Array | None = None) -> Array:
        """Stack inputs as columns, shape (m, d).

        Further inputs that are not given are set to the mean of the training rows.

        Args:
            F_n: normal force [N], shape (m,).
            v_t: slip velocity [m/s], shape (m,).
            further: other inputs, shape (m, d - 2).
        """
        means = self.centre[2:]  # of the further inputs
        if further is None and means.size:
            further = np.broadcast_to(means, (F_n.size, means.size))
        return inputs_of(F_n, v_t, further)

    def factor(self) -> Factor:
        """Factorise the covariance of the training rows."""
        return _factor(self.kernel, self.noise, self.theta, self.X, self.trials)

    def describe(self) -> dict[str, Any]:
        """Return hyperparameters, likelihood, starts, jitter and standardisation."""
        names = (*self.kernel.names, *self.noise.names)
        return {
            "theta": dict(zip(names, self.theta.tolist(), strict=True)),
            "lml": self.lml,
            "starts": [s._asdict() | {"theta": list(s.theta)} for s in self.starts],
            "jitter": self.jitter,
            "centre": self.centre.tolist(),
            "scale": self.scale.tolist(),
            "offset": self.offset,
        }

    def given(
        self, inputs: Array, y: Array, trials: TrialRows | None = None
    ) -> "GaussianProcess":
        """Condition the process on other training rows with the same hyperparameters.

        Standardisation and offset remain those of the original rows.

        Args:
            inputs: training inputs in their units, shape (n, d).
            y: training outputs, shape (n,).
            trials: trial of every row.
        """
        _, theta_noise = split(self.kernel, self.theta)
        X, r = (inputs - self.centre) / self.scale, y - self.offset
        factor = _factor(self.kernel, self.noise, self.theta, X, trials)
        alpha = factor.solve(r)
        spread = float(np.log(np.diagonal(factor.L)).sum())
        prior = self.noise.log_prior(theta_noise)[0]
        lml = prior - 0.5 * float(r @ alpha + r.size * np.log(2.0 * np.pi)) - spread
        return replace(
            self, X=X, alpha=alpha, lml=lml, jitter=factor.jitter, trials=trials
        )

    def predict(
        self, inputs: Array, *, include_noise: bool = True
    ) -> tuple[Array, Array]:
        """Return the predictive mean and variance at `inputs`, shape (m, d).

        Args:
            inputs: rows in the units of the training inputs.
            include_noise: variance of a measurement; False gives eq. (7), the variance
                of the function itself.

        Returns:
            Mean and variance, each of shape (m,).
        """
        theta, theta_noise = split(self.kernel, self.theta)
        Z = (inputs - self.centre) / self.scale
        factor = self.factor()
        mean, variance = np.empty(Z.shape[0]), self.kernel.diagonal(theta, Z)
        for i in range(0, Z.shape[0], _BLOCK):
            cross = self.kernel.matrix(theta, self.X, Z[i : i + _BLOCK])
            mean[i : i + _BLOCK] = self.offset + self.alpha @ cross
            half = factor.half(cross)
            variance[i : i + _BLOCK] -= np.einsum("nm,nm->m", half, half)
        variance = np.maximum(variance, 0.0)
        if include_noise:
            variance = variance + self.noise.variance(theta_noise, Z)
        return mean, variance


class LeaveOut:
    """Predictions of a process without some of its training rows.

    Hyperparameters, standardisation and offset are kept. With P = C^-1 of all rows and
    b the rows left out, the inverse covariance of the others is
    P - P_.b P_bb^-1 P_b. (partitioned inverse; for one row Rasmussen and Williams
    2006, eq. 5.12). With k the covariances of a new row and A = P_b. k this gives

        mean = k'alpha - A'P_bb^-1 alpha_b,  variance = k** - k'P k + A'P_bb^-1 A

    where rows b cancel, whatever their covariance with the new row is.

    Args:
        process: process fitted to the rows in `process.X`.
    """

    def __init__(self, process: GaussianProcess) -> None:
        self._process = process
        self._factor = process.factor()
        self._P = self._factor.inverse()

    def predict(self, rows: slice, inputs: Array) -> tuple[Array, Array]:
        """Return mean and variance of measurements at `inputs` without some rows.

        Args:
            rows: training rows to leave out.
            inputs: rows in the units of the training inputs, shape (m, d).

        Returns:
            Mean and variance, noise included, each of shape (m,).
        """
        process = self._process
        theta, theta_noise = split(process.kernel, process.theta)
        Z = (inputs - process.centre) / process.scale
        cross = process.kernel.matrix(theta, process.X, Z)
        half = self._factor.half(cross)
        L_left, _ = lapack("potrf")(self._P[rows, rows], lower=1, clean=1)
        joint = np.column_stack([self._P[rows] @ cross, process.alpha[rows]])
        left = Factor(L_left, 0.0).half(joint)
        mean = process.offset + process.alpha @ cross - left[:, -1] @ left[:, :-1]
        variance = process.kernel.diagonal(theta, Z)
        variance -= np.einsum("nm,nm->m", half, half)
        variance += np.einsum("nm,nm->m", left[:, :-1], left[:, :-1])
        return mean, np.maximum(variance, 0.0) + process.noise.variance(theta_noise, Z)


def _factor(
    kernel: Kernel, noise: Noise, theta: Array, X: Array, trials: TrialRows | None
) -> Factor:
    """Factorise the covariance of training rows."""
    theta_kernel, theta_noise = split(kernel, theta)
    S, _ = noise.evaluate(theta_noise, X)
    blocks = shared_over(noise, trials)(theta_noise).blocks
    K, _ = kernel.over(X)(theta_kernel)  # its upper triangle
    return factorise(K, S, blocks=blocks)


def fit_gp(
    inputs: Array,
    y: Array,
    kernel: Kernel | None = None,
    noise: Noise | None = None,
    *,
    is_centred: bool = True,
    trials: TrialRows | None = None,
) -> GaussianProcess:
    """Fit a Gaussian process to `y`.

    Args:
        inputs: training inputs, shape (n, d); standardised here.
        y: training outputs, shape (n,).
        kernel: covariance function, by default squared exponential.
        noise: noise of the measurements, by default constant.
        is_centred: subtract the mean of `y` first; False if another mean function was
            subtracted already.
        trials: trial of every row, for noise shared within trials.

    Raises:
        SettingsError: fewer than 20 rows, or outputs that do not vary.
    """
    check_outputs(y)
    kernel = kernel or SquaredExponential(inputs.shape[1])
    noise = noise or ConstantNoise()
    centre, scale = inputs.mean(axis=0), spread(inputs)
    X, offset = (inputs - centre) / scale, float(y.mean()) if is_centred else 0.0
    likelihood = Likelihood(kernel, noise, X, y - offset, trials)
    optimum = maximise_posterior(likelihood)
    alpha, jitter = likelihood.weights(optimum.theta)
    return GaussianProcess(
        kernel=kernel,
        noise=noise,
        theta=optimum.theta,
        X=X,
        alpha=alpha,
        offset=offset,
        centre=centre,
        scale=scale,
        lml=optimum.lml,
        starts=optimum.starts,
        jitter=jitter,
        at_bound=optimum.at_bound,
        trials=trials,
    )


def check_outputs(y: Array) -> None:
    """Raise SettingsError if `y` has fewer than 20 rows or does not vary."""
    if y.size < MINIMUM_ROWS or np.ptp(y) == 0:
        span = float(np.ptp(y)) if y.size else 0.0
        raise SettingsError(
            f"No Gaussian process from {y.size} samples spanning {span:.3g} N "
            f"(at least {MINIMUM_ROWS} that differ).",
            hint="Record more motion inside the window of velocities.",
        )
