"""Factors that every terrain states and that vary become levels to classify."""

from types import SimpleNamespace

import pytest

from analysis.terrains.identify import words_of


def study_of(**factors):
    """Return a study with nothing but the factors of its terrains."""
    terrains = {n: SimpleNamespace(factors=f) for n, f in factors.items()}
    return SimpleNamespace(terrains=terrains)


@pytest.mark.parametrize(
    ("factors", "levels"),
    [
        ({"A": {"foot": "tread"}, "B": {"foot": "bare"}}, {}),
        (
            {
                "A": {"foot": "tread", "moisture": "dry"},
                "B": {"foot": "bare", "moisture": "dry"},
            },
            {"foot": {"A": "tread", "B": "bare"}},
        ),
        (
            {"A": {"moisture": "dry", "d50": 19.0}, "B": {"moisture": "wet"}},
            {"moisture": {"A": "dry", "B": "wet"}},
        ),
        ({"A": {"moisture": "dry"}, "B": {"moisture": None}}, {}),
        ({"A": {"moisture": "dry"}, "B": {}}, {}),
    ],
)
def test_a_factor_is_stated_by_every_terrain_and_varies(factors, levels):
    assert words_of(study_of(**factors)) == levels
