import pytest

from analysis.data.terrain_kinds import (
    class_labels,
    kind_title,
    surface_of,
    terrain_kind,
)


@pytest.mark.parametrize(
    ("terrain", "stones", "kind"),
    [
        ("Sand", ["none", "none"], "flat"),
        ("Beach", ["small"], "small"),
        ("S10", ["big"], "big"),
        ("S10", ["", "big"], "big"),
    ],
)
def test_recorded_stones_decide_the_kind_and_not_the_name(terrain, stones, kind):
    assert terrain_kind(terrain, stones) == kind


@pytest.mark.parametrize(
    ("terrain", "kind"), [("S10", "small"), ("B0", "big"), ("Tf", "flat")]
)
def test_without_stones_the_papers_names_imply_theirs(terrain, kind):
    assert terrain_kind(terrain, [""]) == kind


@pytest.mark.parametrize("stones", [[], [""], ["gravel"], ["small", "none"]])
def test_unknown_or_contradicting_stones_are_a_separate_kind(stones):
    assert terrain_kind("Tundra", stones) == "Tundra"
    assert kind_title("Tundra") == surface_of("Tundra") == "Tundra"


def test_terrains_are_grouped_by_name_stones_and_surface():
    groups = class_labels({"Sand": "flat", "Beach": "small", "B0": "big"})
    assert groups["terrain"]["Beach"] == "Beach"
    assert groups["stones"] == {"Sand": "flat", "Beach": "small", "B0": "big"}
    assert groups["surface"] == {"Sand": "flat", "Beach": "rocky", "B0": "rocky"}
