"""Conditions of --where, and the order of a matrix with factors."""

import itertools

import pytest

from acquisition.errors import SettingsError
from experiments.session.upcoming import next_steps, suggest_order
from experiments.session.where import check_values, parse_where
from experiments.settings.load import load_settings
from experiments.settings.matrix import Design

FACTS = {"d50": 19.0, "moisture": "wet", "load": None, "incline_deg": -10.0}


@pytest.mark.parametrize(
    ("text", "holds"),
    [
        ("d50>=19", True),
        ("d50>19", False),
        ("d50=19", True),
        ("d50=19.0", True),
        ("d50!=19", False),
        ("d50<20,d50>10", True),
        ("moisture=wet", True),
        ("moisture!=wet", False),
        ("incline_deg<0", True),
        ("incline_deg<=-10", True),
        ("load=-", True),
        ("load!=-", False),
        ("load<5", False),
        ("moisture=wet,d50<19", False),
        ("terrain=S0", True),  # not among the facts
    ],
)
def test_numbers_are_compared_and_words_are_equal_or_not(text, holds):
    where = parse_where(text, ("d50", "moisture", "load"))
    assert where.matches(FACTS) is holds
    assert str(where) == text


@pytest.mark.parametrize(
    "text",
    ["d50~3", "hope=1", "d50", "=3", "d50>", "moisture<wet", "d50==3", "d50=>3"],
)
def test_an_invalid_condition_is_refused(text):
    with pytest.raises(SettingsError):
        parse_where(text, ("d50", "moisture"))


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        ("terrain=s0", "There is B0, S0."),
        ("kind=fake", "There is live, simulated."),
        ("incline_deg=7", "There is 0.0, 15.0."),
        ("incline_deg!=7", "There is 0.0, 15.0."),
        ("load=5", "There is -."),
        ("operator=ada", "There is none yet."),
    ],
)
def test_an_unused_value_is_refused_and_the_known_values_are_reported(text, hint):
    facts = [
        {"terrain": "S0", "incline_deg": 15.0, "kind": "live"},
        {"terrain": "B0", "incline_deg": 0.0, "kind": "simulated", "load": None},
    ]
    with pytest.raises(SettingsError) as refused:
        check_values(parse_where(text, ("load",)), facts)
    assert refused.value.hint == hint
    check_values(parse_where("terrain=S0,incline_deg>99,kind=live"), facts)


def matrix(order="randomised", **details):
    """Matrix of three feet on stones of three sizes, dry and wet."""
    shipped = load_settings(None).matrix
    rows = tuple(
        shipped.terrains[0].model_copy(
            update={
                "name": f"{foot[0]}{d:g}{wet[0]}",
                "foot": foot,
                "factors": {"d50": float(d), "moisture": wet},
            }
        )
        for foot in ("tread", "bare", "round")
        for d in (10, 19, 37)
        for wet in ("dry", "wet")
    )
    design = Design(order=order, **details)
    return shipped.model_copy(update={"terrains": rows, "design": design})


NAMES = [row.name for row in matrix().terrains]


def test_only_terrains_that_match_the_condition_are_suggested(tmp_path):
    where = parse_where("moisture=wet,d50<19", ("d50", "moisture"))
    (line,) = next_steps(tmp_path, [], matrix("rows"), where, is_simulated=False)
    assert line == "Next, as the rows stand: t10w b10w r10w"
    none = parse_where("d50>99", ("d50", "moisture"))
    assert next_steps(tmp_path, [], matrix("rows"), none, is_simulated=False) == []


def test_rows_are_suggested_in_the_order_of_the_matrix():
    assert suggest_order(matrix("rows"), []) == NAMES
    assert suggest_order(matrix("rows"), ["t10d"]) == NAMES[1:]


def test_the_seed_decides_the_order_and_recorded_rows_are_left_out():
    order = suggest_order(matrix(seed=1), [])
    assert sorted(order) == sorted(NAMES)
    assert order != NAMES
    assert suggest_order(matrix(seed=1), []) == order
    assert suggest_order(matrix(seed=2), []) != order
    done = [order[3], order[0], "not of this matrix"]
    remaining = [name for name in order if name not in done]
    assert suggest_order(matrix(seed=1), done) == remaining


def test_blocks_are_not_interleaved():
    blocked = matrix("blocked", block_by=("foot",))
    order = suggest_order(blocked, [])
    feet = [name[0] for name in order]
    assert sorted(order) == sorted(NAMES)
    assert sum(a != b for a, b in itertools.pairwise(feet)) == 2
    begun = suggest_order(blocked, ["r19w"])
    assert [name[0] for name in begun[:5]] == ["r"] * 5
    assert order != sorted(order)


def test_cells_are_repeated_once_all_are_recorded():
    twice = matrix(repeat_blocks=1)
    assert len(suggest_order(twice, NAMES[:-1])) == 1
    again = suggest_order(twice, NAMES)
    assert sorted(again) == sorted(NAMES)
    assert again != suggest_order(twice, [])
    assert suggest_order(twice, [*NAMES, *NAMES]) == []
