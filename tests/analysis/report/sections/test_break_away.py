"""A report states forces from rest with their kind and their pushes."""

import json

import numpy as np
import pytest

from analysis.report.findings import plain_findings
from analysis.report.results import compute_results
from analysis.report.sections.beyond_paper.break_away import (
    break_away_findings,
    break_away_table,
    caption_available,
    draw_available,
    draw_risk,
)
from analysis.report.style import styled


@pytest.fixture(scope="module")
def results(small_study):
    return compute_results(small_study)


def cell(table, terrain, column):
    row = next(row for row in table.rows if row[0] == terrain)
    return row[list(table.header).index(column)]


def test_every_terrain_has_its_force_from_rest_and_in_motion(results):
    table = break_away_table(results)
    assert [row[0] for row in table.rows] == ["S0", "B0", "TF"]
    for name in ("S0", "B0"):
        rest = float(cell(table, name, "F_t at risk 0.1 [N]").split()[0])
        motion = float(cell(table, name, "in motion at 0.1 [N]"))
        assert rest > motion
    assert "0.06 m/s" in table.note


def test_the_table_states_the_kind_of_answer(results):
    table = break_away_table(results)
    assert cell(table, "S0", "from rest") == "break-away"
    assert cell(table, "TF", "from rest") == "sliding"
    assert "(" in cell(table, "S0", "distance (limit)")
    assert cell(table, "TF", "distance (limit)") == "–"


def test_counts_are_those_of_the_pushes(results):
    for found in results.of(break_away_findings).values():
        assert int((~found.is_held).sum()) == found.model.slips
        assert int(found.is_held.sum()) == found.model.held


def test_survival_curve_and_model_agree_on_stones(results):
    for name in ("S0", "B0"):
        found = results.of(break_away_findings)[name]
        seen = found.survival.share_below(found.forces)
        # about 17 slips: a standard error of .12
        assert np.abs(seen - found.mean_risk).max() < 0.3
        assert found.model.distance < found.limit


def test_numbers_of_the_report_are_in_its_data_file(results):
    numbers = json.loads(json.dumps(plain_findings(results)["break_away"]))
    known = results.of(break_away_findings)["S0"]
    answer = known.model.available(known.load, 0.1)
    stored = next(a for a in numbers["S0"]["available"] if a["risk"] == 0.1)
    assert stored["force"] == pytest.approx(answer.force)
    assert numbers["S0"]["v_slip"] == 0.06
    assert len(numbers["S0"]["pushes"]) == known.model.slips + known.model.held


def test_censored_peaks_are_marked_separately(results):
    with styled():
        figure = draw_available(results)
        _, labels = figure.axes[0].get_legend_handles_labels()
    assert {"slipped", "held", "risk 0.1"} <= set(labels)
    marks = {line.get_marker() for line in figure.axes[0].get_lines()}
    assert {"o", "^"} <= marks
    assert "0.06 m/s" in caption_available(results)


def test_the_risk_is_shown_with_its_step_curve(results):
    with styled():
        figure = draw_risk(results)
    first = figure.axes[0]
    assert "Kaplan-Meier" in first.get_legend_handles_labels()[1]
    steps = first.get_lines()[0]
    assert steps.get_drawstyle() == "steps-post"
    assert np.diff(steps.get_ydata()).min() >= 0.0
