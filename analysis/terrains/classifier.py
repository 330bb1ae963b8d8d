"""Flat or rocky, from a window of motion: ridge logistic regression on its features.

    p(rocky) = 1 / (1 + exp(-(w0 + w'x))),   x standardised features and their squares

Both kinds weigh alike. Weights minimise the log loss plus a ridge, by Newton's method;
windows that overlap are correlated, so the loss counts every window as the share of it
that is new.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from analysis.data.series import Array
from analysis.terrains.windows import FEATURES, WINDOWS

FLAT_GROUND, ROCKY_GROUND = "flat", "rocky"
_RIDGE = 1.0
_STEPS = 25
_HALVINGS = 20
_LARGEST_NUMBER = 1e9  # of a stored weight, mean or scale
_SMALL = 1e-8
_LARGEST = 5.0  # standard deviations beyond which a feature says no more
_LARGEST_LOGIT = 30.0
_NEW = 0.2  # share of an overlapping window that the one before did not have
_DIGITS = 8


@dataclass(frozen=True, slots=True, eq=False)
class LogisticModel:
    """One logistic regression on standardised features and their squares.

    Attributes:
        mean: of the features, shape (n,).
        scale: their standard deviations, shape (n,).
        weights: bias, features, squares, shape (2 n + 1,).
    """

    mean: Array
    scale: Array
    weights: Array

    @classmethod
    def fit(cls, features: Array, is_rocky: np.ndarray) -> "LogisticModel":
        """Return the fit of windows of both kinds.

        Args:
            features: of every window, shape (m, n).
            is_rocky: the truth, shape (m,); both kinds have to occur.
        """
        mean, scale = features.mean(axis=0), features.std(axis=0) + _SMALL
        X = _design(features, mean, scale)
        rocky = float(is_rocky.mean())
        balance = np.where(is_rocky, 0.5 / rocky, 0.5 / (1.0 - rocky)) * _NEW
        ridge = np.full(X.shape[1], _RIDGE)
        ridge[0] = _SMALL
        problem = _Problem(X, is_rocky, balance, ridge)
        w = np.zeros(X.shape[1])
        for _ in range(_STEPS):
            w = problem.improved(w)
        return cls(mean, scale, w)

    @classmethod
    def of_trials(
        cls, trials: Sequence[tuple[Mapping[int, Array], str]], size: int
    ) -> "LogisticModel | None":
        """Return the fit of trials' windows of one size; None with one kind only."""
        parts = [
            (features[size], surface == ROCKY_GROUND)
            for features, surface in trials
            if surface in (FLAT_GROUND, ROCKY_GROUND) and len(features[size])
        ]
        if len({is_rocky for _, is_rocky in parts}) < 2:
            return None
        features = np.concatenate([part for part, _ in parts])
        is_rocky = np.concatenate([np.full(len(part), kind) for part, kind in parts])
        return cls.fit(features, is_rocky)

    def probability(self, features: Array) -> Array:
        """Return the probability of rocky ground of every window, shape (m,).

        Args:
            features: shape (m, n).
        """
        return _logistic(_design(features, self.mean, self.scale) @ self.weights)

    def to_dict(self) -> dict[str, list[float]]:
        """Return the model as plain numbers."""
        return {
            name: [float(f"{x:.{_DIGITS}g}") for x in getattr(self, name).tolist()]
            for name in ("mean", "scale", "weights")
        }

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> "LogisticModel":
        """Return the model of plain numbers.

        Raises:
            ValueError: a number or the count of them is not what it should be.
            KeyError: some are missing.
        """
        count = len(FEATURES)
        sizes = {"mean": count, "scale": count, "weights": 2 * count + 1}
        parts = {name: np.array(content[name], dtype=np.float64) for name in sizes}
        for name, size in sizes.items():
            is_usual = bool((np.abs(parts[name]) <= _LARGEST_NUMBER).all())
            if parts[name].shape != (size,) or not is_usual:
                raise ValueError(f"{name} of a classifier is not {size} numbers")
        if bool((parts["scale"] < 1.0 / _LARGEST_NUMBER).any()):
            raise ValueError("a scale of a classifier is not positive")
        return cls(**parts)


def _logistic(logit: Array) -> Array:
    return 1.0 / (1.0 + np.exp(-np.clip(logit, -_LARGEST_LOGIT, _LARGEST_LOGIT)))


def _design(features: Array, mean: Array, scale: Array) -> Array:
    z = np.clip((features - mean) / scale, -_LARGEST, _LARGEST)
    return np.column_stack([np.ones(len(z)), z, z * z])


@dataclass(frozen=True, slots=True, eq=False)
class _Problem:
    """A weighted ridge logistic regression.

    Attributes:
        X: columns, shape (m, k).
        is_rocky: the truth, shape (m,).
        balance: weight of every window, shape (m,).
        ridge: penalty of every weight, shape (k,).
    """

    X: Array
    is_rocky: np.ndarray
    balance: Array
    ridge: Array

    def loss(self, w: Array) -> float:
        logit = self.X @ w
        lost = np.logaddexp(0.0, np.where(self.is_rocky, -logit, logit))
        return float(self.balance @ lost + 0.5 * self.ridge @ w**2)

    def improved(self, w: Array) -> Array:
        """Return the weights after a Newton step, halved until nothing is lost."""
        p = _logistic(self.X @ w)
        gradient = self.X.T @ (self.balance * (p - self.is_rocky)) + self.ridge * w
        bend = (self.X.T * (self.balance * p * (1.0 - p))) @ self.X
        step = np.linalg.solve(bend + np.diag(self.ridge), gradient)
        before = self.loss(w)
        for halvings in range(_HALVINGS):
            after = w - 0.5**halvings * step
            if self.loss(after) <= before:
                return after
        return w


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceClassifier:
    """Tells flat ground from rocky by windows of several sizes.

    Attributes:
        models: by size of the window [kept samples].
    """

    models: Mapping[int, LogisticModel]

    def to_dict(self) -> dict[str, Any]:
        """Return the classifier as plain values, for JSON."""
        return {
            "features": list(FEATURES),
            "models": {str(size): m.to_dict() for size, m in self.models.items()},
        }

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> "SurfaceClassifier":
        """Return the classifier of plain values.

        Raises:
            ValueError: a value is not what it should be, or features have changed.
            KeyError: one is missing.
            TypeError: one is of another type.
        """
        if tuple(content["features"]) != FEATURES:
            raise ValueError("a classifier was made for other features")
        models = {
            int(size): LogisticModel.from_dict(model)
            for size, model in dict(content["models"]).items()
        }
        if not set(models) <= set(WINDOWS):
            raise ValueError("a classifier has other windows")
        return cls(models)


def fit_surfaces(
    trials: Sequence[tuple[Mapping[int, Array], str]],
) -> SurfaceClassifier | None:
    """Return the classifier of trials with their surfaces; None with one kind only.

    Args:
        trials: each with the features of its overlapping windows by size, and "flat"
            or "rocky"; other surfaces are left out.
    """
    fitted = {size: LogisticModel.of_trials(trials, size) for size in WINDOWS}
    models = {size: model for size, model in fitted.items() if model is not None}
    return SurfaceClassifier(models) if models else None
