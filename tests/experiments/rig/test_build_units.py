"""Values of the settings reach the program in its units, with all others unchanged."""

from math import radians

import numpy as np
import pytest

from experiments.rig.build import build_tool, terrain_frame
from experiments.settings.load import load_settings
from experiments.settings.matrix import TerrainRow
from ft_sensor.payload import payload_of

RIG = load_settings(None).rig
FOOT = {
    "mass": 0.7,
    "com": (0.01, 0.02, 0.03),
    "inertia": (1e-4, 2e-4, 3e-4),
    "sole": (0.001, 0.002, 0.06),
}
SENSOR = {"angle_deg": 90.0, "sign": -1, "mass": 0.3, "height": 0.041}


@pytest.fixture
def tool():
    sensor = RIG.ft_sensor.model_copy(update=SENSOR)
    foot = RIG.feet["tread"].model_copy(update=FOOT)
    changed = {"ft_sensor": sensor, "feet": RIG.feet | {"tread": foot}}
    return build_tool(RIG.model_copy(update=changed), "tread")


def test_the_foot_of_rig_toml_is_in_kilograms_and_metres(tool):
    assert tool.foot.mass == FOOT["mass"]
    assert tuple(tool.foot.com) == FOOT["com"]
    assert tuple(np.diag(tool.foot.inertia)) == FOOT["inertia"]
    assert tuple(tool.sole) == FOOT["sole"]


def test_the_sensor_of_rig_toml_is_mounted_at_its_angle_in_degrees(tool):
    assert tool.sensor_angle == pytest.approx(radians(90.0))
    turned = payload_of(tool).rotation @ [1.0, 0.0, 0.0]
    assert turned == pytest.approx([0.0, 1.0, 0.0], abs=1e-12)
    assert (tool.sensor_sign, tool.sensor.mass, tool.sensor_height) == (-1, 0.3, 0.041)


@pytest.mark.parametrize(("push", "sense"), [(0, 1.0), (180, -1.0)])
def test_a_row_of_the_matrix_states_its_container_in_degrees(push, sense):
    row = TerrainRow(
        name="S10",
        stones="small",
        foot="tread",
        far_end=(0.4, 0.1, 0.05),
        travel=0.5,
        heading_deg=30.0,
        incline_deg=10.0,
        push_deg=push,
        trials=10,
    )
    frame = terrain_frame(row)
    assert frame.incline == pytest.approx(sense * radians(10.0))
    assert (frame.start == row.far_end) is (push == 0)
    outward = -sense * frame.axes()[0]  # x_T points to the base
    assert np.degrees(np.arctan2(outward[1], outward[0])) == pytest.approx(30.0)
