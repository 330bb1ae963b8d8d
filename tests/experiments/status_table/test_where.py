"""Conditions of --where, and the order of a matrix with factors."""

import itertools

import pytest

from acquisition.errors import SettingsError
from experiments.status_table.summary_cache import StatusMatrix, StatusRow
from experiments.status_table.upcoming import (
    factor_columns,
    next_steps,
    suggest_order,
)
from experiments.status_table.where import parse_where

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
        ("terrain=S0", True),  # not known of it
    ],
)
def test_numbers_are_compared_and_words_are_equal_or_not(text, holds):
    where = parse_where(text, ("d50", "moisture", "load"))
    assert where.matches(FACTS) is holds
    assert str(where) == text


@pytest.mark.parametrize(
    "text", ["d50~3", "hope=1", "d50", "=3", "d50>", "moisture<wet"]
)
def test_what_is_no_condition_is_refused(text):
    with pytest.raises(SettingsError):
        parse_where(text, ("d50", "moisture"))


def cell(name, foot="tread", blocks=1, **factors):
    return StatusRow(
        *(name, "small", 0.0, foot, 3, "small", "grid"), factors=factors, blocks=blocks
    )


def matrix(order, blocks=1, **details):
    rows = tuple(
        cell(f"{foot[0]}{d:g}{wet[0]}", foot, blocks, d50=float(d), moisture=wet)
        for foot in ("tread", "bare", "round")
        for d in (10, 19, 37)
        for wet in ("dry", "wet")
    )
    return StatusMatrix(rows, order, **details)


def test_only_what_was_asked_for_is_suggested(tmp_path):
    where = parse_where("moisture=wet,d50<19", ("d50", "moisture"))
    (line,) = next_steps(tmp_path, [], matrix("rows"), where, is_simulated=False)
    assert line == "Next, as the rows stand: t10w b10w r10w"
    none = parse_where("d50>99", ("d50", "moisture"))
    assert next_steps(tmp_path, [], matrix("rows"), none, is_simulated=False) == []


def test_rows_come_as_they_stand():
    names = [row.name for row in matrix("rows").rows]
    assert suggest_order(matrix("rows"), []) == names
    assert suggest_order(matrix("rows"), ["t10d"]) == names[1:]


def test_blocks_are_done_in_one_go():
    blocked = matrix("blocked", block_by=("foot",))
    order = suggest_order(blocked, [])
    feet = [name[0] for name in order]
    assert sorted(order) == sorted(row.name for row in blocked.rows)
    assert sum(a != b for a, b in itertools.pairwise(feet)) == 2
    begun = suggest_order(blocked, ["r19w"])
    assert [name[0] for name in begun[:5]] == ["r"] * 5
    assert order != sorted(order)


def test_cells_come_again_when_all_were_recorded():
    twice = matrix("randomised", blocks=2)
    names = [row.name for row in twice.rows]
    assert len(suggest_order(twice, names[:-1])) == 1
    again = suggest_order(twice, names)
    assert sorted(again) == sorted(names)
    assert suggest_order(twice, [*names, *names]) == []


def test_numbers_and_words_become_columns():
    columns = factor_columns(matrix("randomised", logs=("d50",)))
    # foot: two of three levels; ln d50; moisture: one of two; the rest is constant
    spread = {tuple(c) for c in zip(*columns.values(), strict=True) if len(set(c)) > 1}
    assert len(spread) == 4
