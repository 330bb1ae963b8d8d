"""Ridge logistic regression on standardised features and their squares.

    p = 1 / (1 + exp(-(w0 + w'z + v'z^2)))

The fit is Newton's method on the log loss plus a ridge penalty, with step halving until
the loss does not increase.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import Field, TypeAdapter

from acquisition.validation import Many
from analysis.data.series import Array

_CLIPPED_AT = 5.0  # standard deviations at which features are clipped
_LARGEST_LOGIT = 30.0
_STEPS, _HALVINGS = 25, 14
_CONVERGED = 1e-4
_RIDGE = 1.0  # penalty of every weight but the bias
_SMALL = 1e-9
_LARGEST_NUMBER = 1e9  # limit of a stored number

_Number = Annotated[
    float, Field(ge=-_LARGEST_NUMBER, le=_LARGEST_NUMBER, allow_inf_nan=False)
]
_Scale = Annotated[_Number, Field(ge=1.0 / _LARGEST_NUMBER)]


@dataclass(frozen=True, slots=True)
class RidgeLogistic:
    """A fitted regression.

    Attributes:
        mean: means of the features, shape (n,).
        scale: standard deviations of the features, shape (n,).
        weights: weights of bias, features and squares, shape (1 + 2 n,).
    """

    mean: Many[_Number]
    scale: Many[_Scale]
    weights: Many[_Number]

    def probabilities(self, features: Array) -> Array:
        """Return the probability of every row of features, shape (m,).

        Args:
            features: rows of features, shape (m, n).
        """
        design = _design(features, np.array(self.mean), np.array(self.scale))
        return _logistic(design @ np.array(self.weights))

    @classmethod
    def from_dict(cls, content: Mapping[str, Any], count: int) -> "RidgeLogistic":
        """Restore a regression from plain values.

        Args:
            content: mean, scale and weights.
            count: expected number of features.

        Raises:
            ValueError: a value is missing or invalid.
        """
        return _PLAIN.validate_python(content).checked(count)

    def checked(self, count: int) -> "RidgeLogistic":
        """Return the regression itself after a check of its sizes.

        Raises:
            ValueError: the regression is not for `count` features.
        """
        sizes = {"mean": count, "scale": count, "weights": 1 + 2 * count}
        for name, size in sizes.items():
            if len(getattr(self, name)) != size:
                raise ValueError(f"{name} of a regression is not {size} numbers")
        return self


_PLAIN = TypeAdapter(RidgeLogistic)


def fit_logistic(features: Array, truth: np.ndarray, weight: Array) -> RidgeLogistic:
    """Fit a regression to rows; both classes have to occur.

    Args:
        features: shape (m, n).
        truth: whether the row is positive, shape (m,).
        weight: weight of every row, shape (m,).

    Raises:
        ValueError: only one class occurs.
    """
    if not 0 < int(truth.sum()) < truth.size:
        raise ValueError("only one answer occurs")
    mean, scale = features.mean(axis=0), features.std(axis=0) + _SMALL
    design = _design(features, mean, scale)
    penalty = np.full(design.shape[1], _RIDGE)
    penalty[0] = _SMALL
    loss = _Loss(design, truth.astype(np.bool_), weight, penalty)
    w = np.zeros(design.shape[1])
    share = float(weight @ truth) / float(weight.sum())
    w[0] = np.log(share / (1.0 - share))
    iterate = loss.at(w)
    for _ in range(_STEPS):
        before, iterate = iterate, loss.improved(iterate)
        if float(np.abs(iterate.w - before.w).max()) < _CONVERGED:
            break
    columns = (mean, scale, iterate.w)
    plain_mean, plain_scale, plain_w = (tuple(c.tolist()) for c in columns)
    return RidgeLogistic(plain_mean, plain_scale, plain_w)


def fit_balanced(
    parts: Sequence[tuple[Array, bool]], new: float
) -> RidgeLogistic | None:
    """Fit a class-balanced regression to windows; None if only one class occurs.

    Both classes have the same total weight. Overlapping windows are correlated, so each
    is weighted by its share of new samples.

    Args:
        parts: features of windows, shape (m, n), and whether they are positive.
        new: share of a window that the previous one does not contain.
    """
    filled = [(features, kind) for features, kind in parts if len(features)]
    if len({kind for _, kind in filled}) < 2:
        return None
    X = np.concatenate([features for features, _ in filled])
    truth = np.concatenate([np.full(len(part), kind) for part, kind in filled])
    share = float(truth.mean())
    balance = np.where(truth, 0.5 / share, 0.5 / (1.0 - share)) * new
    return fit_logistic(X, truth, balance)


def _logistic(logit: Array) -> Array:
    return 1.0 / (1.0 + np.exp(-np.clip(logit, -_LARGEST_LOGIT, _LARGEST_LOGIT)))


def _design(features: Array, mean: Array, scale: Array) -> Array:
    z = np.clip((features - mean) / scale, -_CLIPPED_AT, _CLIPPED_AT)
    return np.column_stack([np.ones(len(z)), z, z * z])


class _Iterate(NamedTuple):
    """Weights with the logit of every row and the loss."""

    w: Array
    logit: Array
    loss: float


@dataclass(frozen=True, slots=True, eq=False)
class _Loss:
    """Weighted log loss with a ridge.

    Attributes:
        design: shape (m, k).
        truth: shape (m,).
        weight: shape (m,).
        penalty: shape (k,).
    """

    design: Array
    truth: np.ndarray
    weight: Array
    penalty: Array

    def at(self, w: Array) -> _Iterate:
        logit = self.design @ w
        lost = np.logaddexp(0.0, np.where(self.truth, -logit, logit))
        loss = float(self.weight @ lost + 0.5 * self.penalty @ w**2)
        return _Iterate(w, logit, loss)

    def improved(self, iterate: _Iterate) -> _Iterate:
        """Take a Newton step, halved until the loss does not increase."""
        w, p = iterate.w, _logistic(iterate.logit)
        gradient = self.design.T @ (self.weight * (p - self.truth)) + self.penalty * w
        hessian = (self.design.T * (self.weight * p * (1.0 - p))) @ self.design
        step = np.linalg.solve(hessian + np.diag(self.penalty), gradient)
        for halvings in range(_HALVINGS):
            after = self.at(w - 0.5**halvings * step)
            if after.loss <= iterate.loss:
                return after
        return iterate
