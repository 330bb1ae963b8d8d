"""What fits cost, beside scikit-learn and 20-start least squares in the same run.

Equal starts, one linear-algebra thread each, parts alternating, so that whatever else
the machine does meets all of them. Medians over rounds.
"""

import argparse
import json
import statistics
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import (
    RBF,
    ConstantKernel,
    Hyperparameter,
    Kernel,
    WhiteKernel,
)
from threadpoolctl import threadpool_limits

from analysis.arcsine import Arcsine
from analysis.gp import fit_gp, likelihood
from analysis.kernels import SquaredExponential
from analysis.noise import ConstantNoise
from analysis.prepare import PrepareOptions, prepare
from analysis.rows import Rows
from analysis.search import STARTS
from analysis.sparse import fit_sparse
from analysis.tables import load_tables
from analysis.tustin import TustinBounds, TustinParameters, fit_tustin, predict

SLICE = Path(__file__).parents[1] / "tests" / "data" / "rehearsal_slice.npz"
_POINTS = 300
_STARTS_OF_TUSTIN = 20
_GOALS = {"evaluation": 5.0, "SE fit": 4.0, "NN fit": 2.0, "Tustin fit": 10.0}


class NeuralNetwork(Kernel):
    """The arcsine kernel of unit variance for scikit-learn, by its own interface."""

    def __init__(self, lengths: object = (1.0, 1.0), beta: float = 1.0) -> None:
        self.lengths, self.beta = lengths, beta

    @property
    def hyperparameter_lengths(self) -> Hyperparameter:
        """Lengths, one per input."""
        return Hyperparameter("lengths", "numeric", (np.exp(-4), np.exp(6)), 2)

    @property
    def hyperparameter_beta(self) -> Hyperparameter:
        """Share of the bias."""
        return Hyperparameter("beta", "numeric", (np.exp(-6), np.exp(6)))

    def __call__(self, X, Y=None, eval_gradient=False):  # noqa: ANN001, ANN204
        """Return the covariances and, if asked for, their derivatives."""
        lengths = np.asarray(self.lengths)
        Y = X if Y is None else Y
        Z, Z_other = 2.0 * X / lengths**2, Y
        N = self.beta + Z @ Z_other.T
        A = 1.0 + self.beta + np.sum(Z * X, axis=1)
        B = 1.0 + self.beta + np.sum(2.0 * Y * Y / lengths**2, axis=1)
        root = np.sqrt(np.outer(A, B))
        u = np.clip(N / root, -1.0, 1.0)
        K = np.arcsin(u)
        if not eval_gradient:
            return K
        q = 1.0 / np.sqrt(1.0 - u * u)
        slopes = []
        for d in range(X.shape[1]):
            own, other = X[:, d] ** 2 / A, Y[:, d] ** 2 / B
            part = -4.0 * np.outer(X[:, d], Y[:, d]) / root
            slopes.append(q * (part + 2.0 * u * np.add.outer(own, other))
                          / lengths[d] ** 2)  # fmt: skip
        bias = self.beta * q * (1.0 / root - 0.5 * u * np.add.outer(1.0 / A, 1.0 / B))
        return K, np.stack([bias, *slopes], axis=-1)

    def diag(self, X):  # noqa: ANN001, ANN201
        """Return the variances."""
        p = self.beta + np.sum(2.0 * (X / np.asarray(self.lengths)) ** 2, axis=1)
        return np.arcsin(p / (1.0 + p))

    def is_stationary(self) -> bool:
        """Return that it is not."""
        return False


def load_rows() -> Rows:
    """Return the kept samples of three trials on stones."""
    return Rows.of([prepare(s, PrepareOptions()) for s in load_tables([SLICE])["S0"]])


def chosen(rows: Rows) -> tuple[np.ndarray, np.ndarray]:
    """Return 300 standardised inputs and centred outputs."""
    index = np.random.default_rng(0).choice(rows.count, _POINTS, replace=False)
    X, y = rows.inputs[index], rows.F_t[index]
    return (X - X.mean(axis=0)) / X.std(axis=0), y - y.mean()


def theirs(part: str, stretch: float, share: float, sd: float) -> Kernel:
    """Return scikit-learn's kernel at one of our starts, with our bounds."""
    shape: Kernel = (
        RBF([stretch, stretch], (np.exp(-4), np.exp(6)))
        if part == "SE fit"
        else NeuralNetwork((stretch, stretch), 20.0 ** (-np.log(stretch) / np.log(3.0)))
    )
    size = ConstantKernel(sd**2, (sd**2 * np.exp(-12), sd**2 * np.exp(8)))
    noise = (sd * share) ** 2
    return size * shape + WhiteKernel(noise, (sd**2 * np.exp(-12), sd**2 * np.exp(4)))


def fit_theirs(part: str, X: np.ndarray, y: np.ndarray) -> float:
    """Return the best likelihood scikit-learn reaches from the same three starts."""
    reached = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a length at its bound is no error
        for stretch, share in STARTS:
            kernel = theirs(part, stretch, share, float(y.std()))
            model = GaussianProcessRegressor(kernel, alpha=1e-10).fit(X, y)
            reached.append(model.log_marginal_likelihood_value_)
    return float(max(reached))


def many_starts(rows: Rows) -> float:
    """Return the best sum of squares of 20-start bounded least squares."""
    pairs = np.array([pair for _, pair in TustinBounds().items()])
    low, high = pairs.T.copy()
    for k in (2, 3):
        low[k], high[k] = np.log(pairs[k])

    def residual(x: np.ndarray) -> np.ndarray:
        parameters = TustinParameters(x[0], x[1], *np.exp(x[2:4]), x[4])
        return predict(parameters, rows.F_n, rows.v_t) - rows.F_t

    rng = np.random.default_rng(1)
    starts = rng.uniform(low, high, (_STARTS_OF_TUSTIN, 5))
    return min(
        2.0 * least_squares(residual, x, bounds=(low, high)).cost for x in starts
    )


def duel(
    ours: Callable[[], object], other: Callable[[], object], rounds: int
) -> tuple[float, float]:
    """Return both medians [s], the two taking turns."""
    spent: tuple[list[float], list[float]] = ([], [])
    for _ in range(rounds):
        for function, times in zip((ours, other), spent, strict=True):
            before = time.perf_counter()
            function()
            times.append(time.perf_counter() - before)
    return statistics.median(spent[0]), statistics.median(spent[1])


def measure(rounds: int) -> list[dict[str, object]]:
    """Return every part with its times, their ratio and what was reached."""
    rows = load_rows()
    X, y = chosen(rows)
    theta = np.log([y.std(), 1.0, 1.0, 0.5 * y.std()])
    se = (SquaredExponential(), ConstantNoise())
    kernel = theirs("SE fit", 1.0, 0.5, float(y.std()))
    model = GaussianProcessRegressor(kernel, alpha=1e-10, optimizer=None).fit(X, y)
    at = model.kernel_.theta
    parts = [
        (
            "evaluation",
            lambda: likelihood(se, theta, X, y)[0],
            lambda: model.log_marginal_likelihood(
                at, eval_gradient=True, clone_kernel=False
            )[0],
            10 * rounds,
        ),
        (
            "SE fit",
            lambda: fit_gp(X, y).lml,
            lambda: fit_theirs("SE fit", X, y),
            rounds,
        ),
        (
            "NN fit",
            lambda: fit_gp(X, y, Arcsine()).lml,
            lambda: fit_theirs("NN fit", X, y),
            rounds,
        ),
        (
            "Tustin fit",
            lambda: fit_tustin(rows.F_n, rows.v_t, rows.F_t).sse,
            lambda: many_starts(rows),
            rounds,
        ),
        (
            f"all {rows.count} samples, sparse, beside {_POINTS} exact",
            lambda: fit_sparse(rows.inputs, rows.F_t).lml,
            lambda: fit_gp(X, y).lml,
            rounds,
        ),
    ]
    found = []
    for name, ours, other, count in parts:
        mine, its = duel(ours, other, count)
        found.append(
            {
                "part": name,
                "ours_ms": 1e3 * mine,
                "other_ms": 1e3 * its,
                "ratio": its / mine,
                "goal": _GOALS.get(name),
                "reached": ours(),
                "other_reached": other(),
            }
        )
    return found


def main() -> None:
    """Measure and print one line per part, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    with threadpool_limits(1):
        found = measure(arguments.rounds)
    if arguments.json:
        print(json.dumps(found, indent=1))
        return
    for part in found:
        goal = f" (goal {part['goal']:g})" if part["goal"] else ""
        print(
            f"{part['part']}: {part['ours_ms']:.2f} ms, other {part['other_ms']:.2f} "
            f"ms, ratio {part['ratio']:.1f}{goal}; reached {part['reached']:.4f}, "
            f"other {part['other_reached']:.4f}"
        )


if __name__ == "__main__":
    main()
