"""Uncertainties and tests in the tables of a report."""

import re
from dataclasses import replace

import numpy as np
import pytest

from analysis.report.cell_texts import interval_text, paired_cells
from analysis.report.results import compute_results
from analysis.report.sections.beyond_paper.paired_comparisons import paired_table
from analysis.report.sections.beyond_paper.predicted_uncertainty import (
    uncertainty_table,
)
from analysis.report.sections.beyond_paper.residuals import (
    independent_samples,
    residual_bands,
)
from analysis.report.sections.summary.section import parameters
from analysis.study.metrics import PairedComparison, standard_error
from analysis.study.models import GP_SE, TITLES
from analysis.tustin.identifiability import Interval, Profiles, correlation_samples
from analysis.tustin.model import TustinBounds

BOUNDS = TustinBounds()


def cell(table, terrain, column):
    row = next(row for row in table.rows if row[0] == terrain)
    return row[list(table.header).index(column)]


def test_a_paired_p_value_is_shown_with_the_adjusted_one():
    pairs = [PairedComparison(-0.1, 0.01, p, 10) for p in (0.002, 0.04)]
    first, missing, second = paired_cells([pairs[0], None, pairs[1]])
    assert "p 0.002, Holm 0.004" in first
    assert "p 0.04, Holm 0.04" in second
    assert missing == "–"


@pytest.mark.slow
def test_the_note_states_the_number_of_comparisons(small_study):
    table = paired_table(small_study, "mae", "N")
    count = sum(text.count("Holm") for row in table.rows for text in row[1:])
    assert count == 3 * 4  # terrains, models after the first
    assert f" {count} comparisons" in table.note


def test_coverage_carries_its_standard_error_over_the_trials(small_study):
    shares = small_study.terrains["S0"].scores(GP_SE, "coverage95")
    table = uncertainty_table(small_study)
    row = next(r for r in table.rows if tuple(r[:2]) == ("S0", TITLES[GP_SE]))
    text = row[list(table.header).index("95%")]
    assert text == f"{np.mean(shares):.1%} ± {standard_error(shares):.1%}"


@pytest.mark.slow
def test_independent_samples_are_samples_over_the_correlation_time(small_study):
    results = compute_results(small_study)
    band = results.of(residual_bands)["S0"][GP_SE]
    assert band.samples == small_study.terrains["S0"].kept
    assert band.independent == pytest.approx(band.samples / band.time)
    assert band.independent < 0.1 * band.samples
    table = independent_samples(results)
    assert len(table.rows) == 3 * 2
    assert cell(table, "S0", "kept samples") == str(band.samples)


def test_white_residuals_are_all_independent():
    white = np.random.default_rng(0).normal(size=4000)
    assert correlation_samples(white) == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize(
    ("ends", "text"),
    [
        ((0.001, 0.02), "≤ 0.001 to 0.02"),
        ((0.02, 1.0), "0.02 to ≥ 1"),
        ((0.001, 0.001), "≤ 0.001"),
        ((0.01, 0.02), "0.01 to 0.02"),
    ],
)
def test_an_interval_end_on_a_bound_is_an_inequality(ends, text):
    assert interval_text(BOUNDS, "v_s", Interval(*ends)) == text


@pytest.mark.parametrize(
    ("profile", "is_open"),
    [((0.001, 0.003), True), ((0.01, 0.5), True), ((0.02, 0.05), False)],
)
def test_a_profile_that_does_not_close_is_shown_open(small_study, profile, is_open):
    result = small_study.terrains["S0"]
    profiles = Profiles(Interval(*profile), Interval(1.0, 2.0), touches_edge=True)
    fit = replace(result.whole.fit, profiles=profiles)
    changed = replace(result, whole=replace(result.whole, fit=fit))
    table = parameters(replace(small_study, terrains={"S0": changed}))
    assert ("open: " in cell(table, "S0", "v_s [m/s]")) == is_open
    assert "open" not in cell(table, "S0", "δ_s [1]")


def test_no_bound_is_shown_as_a_plain_interval_end(small_study):
    for row in parameters(small_study).rows:
        assert not re.search(r"(?<!≤ )\b0\.001\b", row[3])
