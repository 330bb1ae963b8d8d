import numpy as np
import pytest

from acquisition.schema import FORESIGHT
from analysis.foresight.engine import ForesightFlag
from experiments.operator.screens import ForesightView, foresight_line
from experiments.rig.foresight_view import foresight_view

TERRAINS = ("S10", "B0", "TF")
GOOD = ForesightFlag.VALID | ForesightFlag.CONTACT | ForesightFlag.GROUND


def records(flags=GOOD, cycle=1000, p=0.34):
    rows = np.zeros(3, FORESIGHT.dtype)
    rows["flags"], rows["cycle"], rows["slip_probability"] = int(flags), cycle, p
    rows["break_away_risk"], rows["traction"], rows["none"] = 0.12, 4.2, 0.01
    rows["terrains"] = np.nan
    rows["terrains"][:, :3] = (0.71, 0.2, 0.08)
    return rows


def line(rows, newest=1000):
    return foresight_line(foresight_view(rows, TERRAINS, newest))


def test_slip_risk_traction_and_likeliest_grounds_stand_in_a_line():
    text = line(records())
    for part in ("0.34", "break-away 0.12", "4.2 N", "S10 0.71", "B0 0.20"):
        assert part in text
    assert "TF" not in text


@pytest.mark.parametrize(
    ("flags", "word"),
    [
        (GOOD | ForesightFlag.SLIPPING, "slipping"),
        (ForesightFlag.VALID, "no contact"),
        (ForesightFlag.OTHER_RIG, "another foot or rig"),
    ],
)
def test_what_has_no_probability_is_a_word(flags, word):
    assert word in line(records(flags))
    assert "0.34" not in line(records(flags))


def test_ground_without_sliding_is_not_known():
    assert "ground ?" in line(records(ForesightFlag.VALID | ForesightFlag.CONTACT))


@pytest.mark.parametrize("newest", [1101, 5000])
def test_a_process_that_is_behind_is_silent(newest):
    assert "silent" in line(records(), newest)
    assert "silent" not in line(records(), 1100)


def test_a_process_that_has_said_nothing_is_silent():
    assert "silent" in line(records()[:0])


def test_values_that_are_not_known_are_no_numbers():
    unknown = ForesightView(np.array([np.nan]), np.nan, np.nan, {}, 0.0)
    assert "break-away ?" in foresight_line(unknown)
