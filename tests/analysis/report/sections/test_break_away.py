"""Report section on the force available from rest: table, figures, data file."""

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


def test_the_table_states_whether_the_model_is_break_away_or_sliding(results):
    table = break_away_table(results)
    assert cell(table, "S0", "from rest") == "break-away"
    assert cell(table, "TF", "from rest") == "sliding"
    assert "(" in cell(table, "S0", "distance (critical)")
    assert cell(table, "TF", "distance (critical)") == "–"


def test_slip_and_hold_counts_match_the_pushes(results):
    for terrain in results.of(break_away_findings).values():
        assert int((~terrain.is_held).sum()) == terrain.model.slips
        assert int(terrain.is_held.sum()) == terrain.model.held


def test_survival_curve_and_model_agree_on_stones(results):
    for name in ("S0", "B0"):
        terrain = results.of(break_away_findings)[name]
        observed_risk = terrain.survival.share_below(terrain.forces)
        # about 17 slips: standard error 0.12
        assert np.abs(observed_risk - terrain.mean_risk).max() < 0.3
        assert terrain.model.distance < terrain.critical_distance


def test_numbers_of_the_report_are_in_its_data_file(results):
    numbers = json.loads(json.dumps(plain_findings(results)["break_away"]))
    terrain = results.of(break_away_findings)["S0"]
    available = terrain.model.available(terrain.load, 0.1)
    stored = next(a for a in numbers["S0"]["available"] if a["risk"] == 0.1)
    assert stored["force"] == pytest.approx(available.force)
    assert numbers["S0"]["v_slip"] == 0.06
    assert len(numbers["S0"]["pushes"]) == terrain.model.slips + terrain.model.held


def test_censored_peaks_are_marked_separately(results):
    with styled():
        figure = draw_available(results)
        _, labels = figure.axes[0].get_legend_handles_labels()
    assert {"slipped", "held", "risk 0.1"} <= set(labels)
    marks = {line.get_marker() for line in figure.axes[0].get_lines()}
    assert {"o", "^"} <= marks
    assert "0.06 m/s" in caption_available(results)


def test_the_risk_figure_shows_the_kaplan_meier_curve(results):
    with styled():
        figure = draw_risk(results)
    first = figure.axes[0]
    assert "Kaplan-Meier" in first.get_legend_handles_labels()[1]
    steps = first.get_lines()[0]
    assert steps.get_drawstyle() == "steps-post"
    assert np.diff(steps.get_ydata()).min() >= 0.0
