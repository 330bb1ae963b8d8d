"""The bound on the likelihood that a sparse Gaussian process is fitted by.

See `analysis.gp.sparse` for its formula (Titsias 2009).
"""

from typing import NamedTuple

import numpy as np

from analysis.data.series import Array
from analysis.gp.kernels import Kernel
from analysis.gp.likelihood import factorise, split
from analysis.gp.noise import Noise

JITTER = 1e-8  # on K_uu, times its mean variance


class Projection(NamedTuple):
    """The parts of a bound that its value, slope and prediction share.

    Attributes:
        L_u: Cholesky factor of K_uu, (m, m).
        A: L_u^-1 K_uf S^-1/2, (m, n).
        L_b: Cholesky factor of B = I + A A', (m, m).
        a: (Q + S)^-1 r, (n,).
        quadratic: r' a.
    """

    L_u: Array
    A: Array
    L_b: Array
    a: Array
    quadratic: float


def bound(
    model: tuple[Kernel, Noise],
    theta: Array,
    X: tuple[Array, Array],
    r: Array,
    jitter: float = JITTER,
) -> tuple[float, Array]:
    """Return the bound on the log marginal likelihood of r and its slope in theta.

    With M = (a a' - (Q + S)^-1 + S^-1)/2 the slope is tr(M dQ) - 1/2 sum dk_ii/S_ii
    and, for the noise, 1/2 sum_i [a_i^2 - (Q + S)^-1_ii + (k_ii - Q_ii)/S_ii^2] dS_ii.

    Args:
        model: kernel and noise.
        theta: the kernel's, then the noise's hyperparameters.
        X: inputs (n, d) and inducing inputs (m, d).
        r: outputs with the mean function taken off, shape (n,).
        jitter: share of the mean variance added to K_uu.
    """
    kernel, noise = model
    theta_kernel, theta_noise = split(kernel, theta)
    inputs, inducing = X
    K_uu, contract_uu = kernel.over(inducing, inducing)(theta_kernel)
    K_fu, contract_fu = kernel.over(inputs, inducing)(theta_kernel)
    S, contract_noise = noise.evaluate(theta_noise, inputs)
    part = project(jittered(K_uu, jitter), K_fu, S, r)
    gap = kernel.diagonal(theta_kernel, inputs) - S * np.einsum(
        "mn,mn->n", part.A, part.A
    )
    value = -0.5 * (part.quadratic + float(np.sum(np.log(S) + gap / S)))
    value -= float(np.sum(np.log(np.diagonal(part.L_b))))
    value -= 0.5 * r.size * np.log(2.0 * np.pi)
    W_fu, W_uu, of_noise = _weights(part, S, gap)
    W_uu[np.diag_indices_from(W_uu)] *= 1.0 + jitter
    slope = contract_fu(W_fu) + contract_uu(W_uu)
    slope += kernel.diagonal_slope(theta_kernel, inputs, -0.5 / S)
    return value, np.concatenate([slope, contract_noise(of_noise)])


def jittered(K_uu: Array, jitter: float) -> Array:
    """Return K_uu with a share of its own diagonal on top."""
    return K_uu + np.diag(jitter * np.diagonal(K_uu))


def project(K_uu: Array, K_fu: Array, S: Array, r: Array) -> Projection:
    """Return the parts of a bound: K_uu (m, m), K_fu (n, m), S and r (n,)."""
    from scipy.linalg import solve_triangular

    sd = np.sqrt(S)
    L_u = factorise(K_uu, np.zeros(K_uu.shape[0])).L
    A = solve_triangular(L_u, (K_fu / sd[:, None]).T, lower=True, check_finite=False)
    L_b = factorise(A @ A.T, np.ones(A.shape[0])).L
    white = r / sd
    half = solve_triangular(L_b, A @ white, lower=True, check_finite=False)
    back = solve_triangular(L_b, half, lower=True, trans=1, check_finite=False)
    a = (white - A.T @ back) / sd
    return Projection(L_u, A, L_b, a, float(white @ white - half @ half))


def _weights(part: Projection, S: Array, gap: Array) -> tuple[Array, Array, Array]:
    """Return the weights of dK_fu (n, m), dK_uu (m, m) and 2 dS (n,) in the slope.

    With P = K_uu^-1 K_uf they are 2 M P' and -P M P'.
    """
    from scipy.linalg import solve_triangular

    def solve(L: Array, right: Array, trans: int = 0) -> Array:
        return solve_triangular(L, right, lower=True, trans=trans, check_finite=False)

    sd, eye = np.sqrt(S), np.eye(part.L_u.shape[0])
    of_b = solve(part.L_b, eye)
    B_inverse = of_b.T @ of_b
    L_inverse = solve(part.L_u, eye)
    p_a = L_inverse.T @ (part.A @ (sd * part.a))
    inner = (eye - B_inverse) @ L_inverse
    W_fu = np.outer(part.a, p_a) + (part.A / sd).T @ inner
    BB = part.L_b @ part.L_b.T
    W_uu = -0.5 * (
        np.outer(p_a, p_a) + L_inverse.T @ (BB - 2.0 * eye + B_inverse) @ L_inverse
    )
    half = of_b @ part.A
    inverse_diagonal = (1.0 - np.einsum("mn,mn->n", half, half)) / S
    return W_fu, W_uu, part.a**2 - inverse_diagonal + gap / S**2
