"""Start poses are computed with the sole flat on the far end of the plane."""

import numpy as np
import pytest

from acquisition.errors import SettingsError
from experiments.rig.build import build_tool, start_of, terrain_frame
from experiments.settings.load import load_settings
from wam.model.arm_model import ArmModel
from wam.model.constants import load_constants
from wam.model.start_pose import elbow_up

SETTINGS = load_settings(None)
MODEL = ArmModel(load_constants(), build_tool(SETTINGS.rig, "tread"))


def row(name="S10", **changes):
    return SETTINGS.row(name).model_copy(update=changes)


@pytest.mark.parametrize("name", ["S0", "S10", "S15"])
def test_the_start_pose_is_the_manually_chosen_one(name):
    computed = start_of(row(name, start_q=None), MODEL)
    assert computed == pytest.approx(row(name).start_q, abs=2e-4)


@pytest.mark.parametrize(
    "changes",
    [
        {"incline_deg": -10.0, "far_end": (0.70, 0.0, 0.12)},
        {"incline_deg": -20.0, "far_end": (0.65, 0.0, 0.05)},
        {"incline_deg": 10.0, "push_deg": 180},
        {"heading_deg": 30.0, "far_end": (0.5, 0.32, 0.12)},
        {"heading_deg": -15.0, "far_end": (0.65, 0.0, 0.12)},
    ],
)
def test_the_sole_is_flat_on_the_far_end(changes):
    cell = row(start_q=None, **changes)
    q, frame = start_of(cell, MODEL), terrain_frame(cell)
    position, rotation = MODEL.sole_pose(q)
    assert position == pytest.approx(frame.start, abs=1e-6)
    axes = frame.axes()
    assert rotation[:, 2] == pytest.approx(-axes[2], abs=1e-6)
    assert abs(rotation[:, 0] @ axes[0]) == pytest.approx(1.0, abs=1e-6)
    limits = MODEL.constants
    assert (limits.q_lower < q).all()
    assert (q < limits.q_upper).all()
    assert q[3] > 0.0


def test_the_start_pose_of_an_opposite_push_is_at_the_other_end():
    q = start_of(row(push_deg=180), MODEL)
    near = terrain_frame(row(push_deg=180)).start
    assert MODEL.sole_pose(q)[0] == pytest.approx(near, abs=1e-6)


def test_a_push_in_the_other_direction_crosses_the_same_plane():
    down, up = terrain_frame(row()), terrain_frame(row(push_deg=180))
    assert up.axes()[0] == pytest.approx(-down.axes()[0])
    assert up.axes()[2] == pytest.approx(down.axes()[2])
    assert up.incline == -down.incline
    back = up.from_other_end()
    assert back.start == pytest.approx(down.start)
    assert back.axes() == pytest.approx(down.axes())


def test_an_unreachable_start_pose_is_refused():
    with pytest.raises(SettingsError, match="out of reach"):
        elbow_up(MODEL, terrain_frame(row()).axes(), np.array([1.2, 0.0, 0.1]))
    with pytest.raises(SettingsError, match="S10: The arm cannot"):
        start_of(row(start_q=None, far_end=(1.1, 0.3, 0.1)), MODEL)
