"""A line of the table says whether its goal is met; growth is an exponent."""

import importlib.util

import pytest

from benchmarks.__main__ import NAMES, table_of
from benchmarks.rows import BenchRow
from benchmarks.scale import exponent, folds_of, rows_of


@pytest.mark.parametrize(
    ("row", "verdict"),
    [
        (BenchRow("x", 1.0, "s", 2.0), "met"),
        (BenchRow("x", 3.0, "s", 2.0), "not met"),
        (BenchRow("x", 3.0, "times", 2.0, is_lower_bound=True), "met"),
        (BenchRow("x", 1.0, "times", 2.0, is_lower_bound=True), "not met"),
        (BenchRow("x", 1.0, "s"), ""),
        (BenchRow("x", None, "s", 2.0, note="not installed"), ""),
    ],
)
def test_a_row_states_whether_its_goal_is_met(row, verdict):
    assert row.verdict == verdict


def test_a_row_without_a_value_states_why():
    what, today, goal, _ = BenchRow("x", None, "s", 2.0, note="no GPy").cells()
    assert (what, today, goal) == ("x (no GPy)", "-", "≤ 2 s")


@pytest.mark.parametrize("power", [0.5, 1.0, 2.0])
def test_growth_is_determined_as_an_exponent(power):
    points = [{"count": n, "seconds": 3.0 * n**power} for n in (10, 100, 1000)]
    assert exponent(points, "seconds") == pytest.approx(power)


def test_folds_of_made_trials_are_planned_with_their_cost():
    cost = folds_of(16)
    assert cost["count"] == 16
    assert 0.0 < cost["megabytes"] < 10.0


def test_growth_beyond_linear_is_not_met():
    def costs(power):
        return [
            {"count": n, "seconds": n**power, "megabytes": n, "shipped": n}
            for n in (80, 800)
        ]

    results = {"folds": costs(2.0), "boards": costs(0.9), "empty": 0.1}
    verdicts = {row.what: row.verdict for row in rows_of(results)}
    assert verdicts["planning grows as trials to the power of"] == "not met"
    assert verdicts["`status` grows as sessions to the power of"] == "met"


def test_a_row_of_the_table_names_its_benchmark():
    text = table_of({"scale": [BenchRow("x", 1.0, "s", 2.0)]})
    assert "| x | 1 s | ≤ 2 s | met | scale |" in text


def test_every_benchmark_exists():
    assert all(importlib.util.find_spec(f"benchmarks.{name}") for name in NAMES)
