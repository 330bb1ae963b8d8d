import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.errors import SettingsError
from wam.calibration.gravity_file import (
    GravityCalibration,
    fits_tool,
    gravity_from_toml,
    gravity_to_toml,
)


def calibration(tool):
    return GravityCalibration(
        mus=np.arange(21.0).reshape(7, 3) / 7,
        residual=0.0123,
        rank=12,
        foot="tread",
        tool=tool,
        measured_utc="2027-01-15T08:00:00Z",
        is_simulated=True,
        poses=np.linspace(-1, 1, 14).reshape(2, 7),
        torques=np.linspace(-9, 8, 14).reshape(2, 7),
    )


def test_a_calibration_round_trips_bit_for_bit(example_tool):
    before = calibration(example_tool)
    after = gravity_from_toml(gravity_to_toml(before), "gravity.toml")
    assert (after.mus == before.mus).all()
    assert (after.poses == before.poses).all()
    assert (after.torques == before.torques).all()
    assert (after.tool.foot.inertia == before.tool.foot.inertia).all()
    assert (after.tool.sole == before.tool.sole).all()
    names = ("residual", "rank", "foot", "measured_utc", "is_simulated")
    assert [getattr(after, n) for n in names] == [getattr(before, n) for n in names]


def test_only_the_calibrated_tool_is_accepted(example_tool):
    found = gravity_from_toml(gravity_to_toml(calibration(example_tool)), "g")
    heavier = dataclasses.replace(example_tool.foot, mass=0.46)
    assert fits_tool(found, example_tool)
    assert not fits_tool(found, dataclasses.replace(example_tool, foot=heavier))


@pytest.mark.parametrize(
    "spoil",
    [
        lambda text: text.replace("mus = [", "mus = [1, "),
        lambda text: text.replace("rank = 12", ""),
        lambda text: text.replace("0.0,", "nan,"),
        lambda text: text.replace("0.0,", "1e3,"),
        lambda text: text.replace("is_simulated = true", "is_simulated = 1"),
        lambda text: text.replace("torques = [", "torques = [[0,0,0,0,0,0,0],"),
        lambda text: text.replace("mass = 0.45", 'mass = "heavy"'),
        lambda text: text.replace("[tool.sensor]", "[tool.other]"),
        lambda text: text.replace("residual = 0.0123", "residual = inf"),
        lambda text: text[: len(text) // 2],
        lambda text: "",
    ],
)
def test_a_damaged_file_is_refused_by_name(example_tool, spoil):
    whole = gravity_to_toml(calibration(example_tool))
    spoiled = spoil(whole)
    assert spoiled != whole
    with pytest.raises(SettingsError, match=r"my\.toml is not a gravity calibration"):
        gravity_from_toml(spoiled, "my.toml")


@given(st.text(max_size=200))
def test_any_other_text_is_refused(text):
    with pytest.raises(SettingsError):
        gravity_from_toml(text, "g.toml")
