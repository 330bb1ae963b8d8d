"""The terrains that a figure shows where it cannot show all of them."""

from analysis.study.study import Study
from analysis.study.terrain_fit import TerrainResult

_MOST_KINDS = 4  # shown, a terrain of each


def representatives(study: Study) -> list[TerrainResult]:
    """Return the first terrain of every kind that has kept samples."""
    first: dict[str, TerrainResult] = {}
    for result in study.terrains.values():
        if result.kept:
            first.setdefault(result.kind, result)
    return list(first.values())[:_MOST_KINDS]
