"""Flat or rocky, from a window of motion: logistic regressions on its features.

    p(rocky) = 1 / (1 + exp(-(w0 + w'x))),   x standardised features and their squares

Both kinds weigh alike in the fit.
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
_NEW = 0.2  # share of an overlapping window that the one before did not have
_DIGITS = 8  # of a stored number


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceClassifier:
    """Tells flat ground from rocky by windows of several sizes.

    Attributes:
        models: by size of the window [kept samples].
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
        """Return the classifier of plain values.

        Raises:
            ValueError: a value is missing or not what it should be, or features have
                changed.
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
    """A classifier as it is stored."""

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
    """Return the probability of rocky ground of windows of one size.

    Args:
        trials: as in `fit_surfaces`.
        size: of the window [kept samples].

    Returns:
        The regression; None with one kind of ground only.
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
    """Return the classifier of trials with their surfaces; None with one kind only.

    Args:
        trials: each with the features of its overlapping windows by size, and "flat"
            or "rocky"; other surfaces are left out.
    """
    fitted = {size: fit_surface(trials, size) for size in WINDOWS}
    models = {size: model for size, model in fitted.items() if model is not None}
    return SurfaceClassifier(models) if models else None
