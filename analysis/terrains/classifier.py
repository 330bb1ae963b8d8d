"""Flat or rocky ground from a window of motion: logistic regression on its features.

    p(rocky) = 1 / (1 + exp(-(w0 + w'x))),   x standardised features and their squares

Both classes have the same total weight in the fit.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel

from acquisition.validation import Entries, Many
from analysis.data.series import Array
from analysis.terrains.logistic import RidgeLogistic, fit_balanced
from analysis.terrains.windows import FEATURES, WINDOWS

FLAT_GROUND, ROCKY_GROUND = "flat", "rocky"
_NEW = 0.2  # share of an overlapping window that the previous one does not contain
_DIGITS = 8  # significant digits of a stored number


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceClassifier:
    """Classifier of flat and rocky ground for windows of several sizes.

    Attributes:
        models: regression by window size [kept samples].
    """

    models: Mapping[int, RidgeLogistic]

    def to_dict(self) -> dict[str, Any]:
        """Return the classifier as plain values, for JSON."""
        return {
            "features": list(FEATURES),
            "models": {str(size): _plain(m) for size, m in self.models.items()},
        }

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> "SurfaceClassifier":
        """Restore a classifier from plain values.

        Raises:
            ValueError: a value is missing or invalid, or the features have changed.
        """
        file = _ClassifierFile.model_validate(content)
        if file.features != FEATURES:
            raise ValueError("a classifier was made for other features")
        if not set(file.models) <= set(WINDOWS):
            raise ValueError("a classifier has other windows")
        return cls(
            {
                size: RidgeLogistic.from_dict(model, len(FEATURES))
                for size, model in file.models.items()
            }
        )


class _ClassifierFile(BaseModel):
    """Stored form of a classifier."""

    features: Many[str]
    models: Entries[int, dict[str, Any]]


def _plain(model: RidgeLogistic) -> dict[str, list[float]]:
    """Return a regression as plain numbers."""
    return {
        name: [float(f"{x:.{_DIGITS}g}") for x in getattr(model, name)]
        for name in ("mean", "scale", "weights")
    }


def fit_surface(
    trials: Sequence[tuple[Mapping[int, Array], str]], size: int
) -> RidgeLogistic | None:
    """Fit the probability of rocky ground for windows of one size.

    Args:
        trials: as in `fit_surfaces`.
        size: window size [kept samples].

    Returns:
        The regression; None if only one kind of ground occurs.
    """
    parts = [
        (features[size], surface == ROCKY_GROUND)
        for features, surface in trials
        if surface in (FLAT_GROUND, ROCKY_GROUND)
    ]
    return fit_balanced(parts, _NEW)


def fit_surfaces(
    trials: Sequence[tuple[Mapping[int, Array], str]],
) -> SurfaceClassifier | None:
    """Fit a classifier to labelled trials; None if only one kind occurs.

    Args:
        trials: features of the overlapping windows by size, and "flat" or "rocky", of
            every trial; other surfaces are left out.
    """
    fitted = {size: fit_surface(trials, size) for size in WINDOWS}
    models = {size: model for size, model in fitted.items() if model is not None}
    return SurfaceClassifier(models) if models else None
