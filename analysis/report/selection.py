"""Choice of representative terrains for figures that cannot show all."""

from analysis.study.study import Study
from analysis.study.terrain_fit import TerrainResult

_MOST_KINDS = 4  # kinds shown, with one terrain each


def representatives(study: Study) -> list[TerrainResult]:
    """Return the first terrain with kept samples of every kind, at most four."""
    first: dict[str, TerrainResult] = {}
    for result in study.terrains.values():
        if result.kept:
            first.setdefault(result.kind, result)
    return list(first.values())[:_MOST_KINDS]
