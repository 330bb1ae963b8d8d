"""The proof of what relatives are worth: its figures, and by hand a whole study."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.data.tables import load_tables
from studies.terrain_relatives import (
    MOST_BEHIND_OWN,
    Figures,
    compare,
    left_out_incline,
    shortfalls,
    table,
)

GOOD = Figures("S10", False, 2.40, 2.50, 2.39, 2.40, 2.45, 0.91, 1.0, 0.001)


def test_good_figures_miss_nothing_and_plates_are_not_held_to_them():
    plate = replace(GOOD, terrain="TF", is_plate=True, joint=9.0, unseen_band=0.1)
    assert shortfalls([GOOD, plate]) == []
    assert [line.split()[0] for line in table([GOOD, plate])[1:]] == ["S10", "TF"]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"nine": 2.34}, "S10: +0.060 to nine trials"),
        ({"alone": 2.36}, "S10: +0.040 to three trials alone"),
        ({"alone": 2.42}, "stones: mean gain 0.020"),
        ({"unseen_band": 0.99}, "left-out incline: 90 % band holds 0.990"),
    ],
)
def test_every_limit_is_named_where_it_is_missed(change, words):
    assert words in shortfalls([replace(GOOD, **change)])


def test_the_left_out_incline_is_that_between_known_ones():
    others = [replace(GOOD, terrain=n, unseen_band=0.5) for n in ("S0", "S15")]
    assert left_out_incline([GOOD, *others]) == pytest.approx(0.91)


@pytest.mark.long
@pytest.mark.shared_data
@pytest.mark.timeout(3600)
def test_relatives_of_a_whole_study_are_worth_six_trials(shared_data):
    tables = load_tables([shared_data / "rehearsal_trials.npz"])
    figures = compare({name: list(series) for name, series in tables.items()}, 2, 3)
    stones = [f for f in figures if not f.is_plate]
    assert np.mean([f.joint - f.nine for f in stones]) <= MOST_BEHIND_OWN
    assert min(f.gain for f in stones) >= -0.03
    assert np.mean([f.gain for f in stones]) >= 0.05
    assert 0.85 <= left_out_incline(figures) <= 0.95
