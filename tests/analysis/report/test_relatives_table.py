"""What the report says of other terrains, and where there are too few of them."""

from dataclasses import replace

import pytest

from analysis.report.new_trial_tables import few_relatives, relatives_table
from analysis.study.all_ground import Dissipation
from analysis.study.fits import to_fits
from analysis.study.metrics import Score
from analysis.study.relatives import RelativesOutcome


def scored(nlpd, coverage90=0.9):
    return Score(1.0, 1.4, 0.95, 2.0, nlpd, 0.8, 0.5, coverage90)


def outcome(terrain, relatives, inner=(2.5, 2.6)):
    return RelativesOutcome(
        terrain=terrain,
        relatives=relatives,
        tested=(0, 2),
        joint=(scored(2.30), scored(2.40)),
        alone=(scored(2.5),),
        unseen=(scored(2.6, 0.88), scored(2.6, 0.94)),
        inner_joint=inner[0],
        inner_alone=inner[1],
        dissipation=Dissipation(0.001, 0.03, 0.012),
        c=3.0,
        theta={"log_s0": 0.5},
    )


@pytest.fixture
def study(small_study):
    told = {
        "S0": outcome("S0", ("B0", "S10")),
        "TF": outcome("TF", ("Tf",), inner=(0.6, 0.4)),
    }
    return replace(small_study, relatives=told)


def test_a_row_holds_scores_what_is_used_and_the_band_never_recorded(study):
    rows = {row[0]: row for row in relatives_table(study).rows}
    assert rows["S0"][1:4] == ["B0, S10", "2.350", "2.500"]
    assert rows["S0"][5:8] == ["relatives", "2.600", "91.0%"]
    assert rows["S0"][8] == "0.1%, 3.0%, 1.2%"
    assert rows["TF"][5] == "own trials alone"


def test_the_sentence_names_terrains_of_too_few_relatives_only(study):
    note = relatives_table(study).note
    assert "TF (Tf: own trials alone are better)" in note
    assert "S0" not in note


def test_without_such_terrains_there_is_no_sentence():
    assert few_relatives([outcome("S0", ("B0", "S10"))]) == ""


def test_a_gap_of_a_quarter_overrules_many_relatives_a_small_one_does_not():
    many = ("B0", "S10", "B10")
    assert outcome("S0", many, inner=(2.6, 2.4)).uses_relatives
    assert not outcome("S0", many, inner=(2.7, 2.4)).uses_relatives
    assert not outcome("TF", ("Tf",), inner=(0.6, 0.5)).uses_relatives


def test_fits_hold_the_outcome_as_numbers(study):
    fits = to_fits(study)["relatives"]
    assert fits["S0"]["nlpd_with_relatives"] == pytest.approx(2.35)
    assert fits["TF"]["has_few_relatives"] is True
    assert fits["S0"]["tested"] == [1, 3]
