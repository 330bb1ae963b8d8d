"""The messages of a second screen, decoded by an independent ROS 2 library."""

import json
import re

import numpy as np
import pytest

from acquisition.schema import CYCLE, schema_text
from experiments.commands.live.channels import (
    LIVE_TOPICS,
    ArmFrames,
    LiveEncoder,
)
from experiments.commands.live.server import layout_path
from tests.acquisition.ros import decode
from tests.acquisition.test_schema import filled, numbers_of
from wam.model.arm_model import ArmModel, urdf
from wam.model.constants import load_constants

URDF = urdf(load_constants())
CONFIG = "[ft_sensor]\nheight = 0.012\nangle_deg = 90.0\n"
T_NS = 1_800_000_007_123_456_789


def cycle(seed=1):
    return filled(CYCLE, seed)


def messages(seed=1):
    return LiveEncoder(URDF, CONFIG).messages(cycle(seed)[0], T_NS)


def test_every_field_of_a_cycle_arrives_unchanged():
    message = decode(CYCLE.type_name, messages()["/cycle"])
    for name in numbers_of(CYCLE):
        ours = cycle()[name][0]
        theirs = np.asarray(getattr(message, name))
        assert ours.tobytes() == theirs.astype(ours.dtype).tobytes(), name
    stamp = message.header.stamp
    assert (stamp.sec, stamp.nanosec) == divmod(T_NS, 10**9)


def test_a_sample_gives_every_topic_but_description_and_events():
    separate = {"/robot_description", "/events"}
    assert set(messages()) == set(LIVE_TOPICS) - separate
    for topic, payload in messages().items():
        decode(LIVE_TOPICS[topic], payload)


def matrix(transform):
    x, y, z, w = transform[1]
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


@pytest.mark.parametrize("seed", range(3))
def test_link_frames_agree_with_the_arm_model(seed):
    q = np.random.default_rng(seed).uniform(-1.0, 1.0, 7)
    at, turned = np.zeros(3), np.eye(3)
    names = []
    for link in ArmFrames(URDF).transforms(q):
        at = at + turned @ link.translation
        turned = turned @ matrix((link.translation, link.rotation))
        names.append(link.child)
    assert names[-1] == "wam_tool"
    plate, rotation = ArmModel(load_constants()).plate_pose(q)
    assert at == pytest.approx(plate, abs=1e-12)
    assert turned == pytest.approx(rotation, abs=1e-12)


def test_transforms_include_tool_sensor_and_foot():
    message = decode(LIVE_TOPICS["/tf"], messages()["/tf"])
    frames = {t.child_frame_id: t for t in message.transforms}
    assert {"wam_l7", "wam_tool", "ft_sensor", "foot"} <= set(frames)
    sensor = frames["ft_sensor"]
    assert sensor.header.frame_id == "wam_tool"
    assert sensor.transform.translation.z == 0.012
    assert sensor.transform.rotation.z == pytest.approx(np.sqrt(0.5))
    foot = frames["foot"].transform
    assert foot.translation.x == cycle()["foot_position"][0, 0]


@pytest.mark.parametrize("type_name", sorted(set(LIVE_TOPICS.values())))
def test_field_names_of_a_definition_are_valid_in_ros_2(type_name):
    for line in schema_text(type_name).splitlines():
        words = line.split("#")[0].split()
        if len(words) == 2 and words[0] != "MSG:" and "=" not in words[1]:
            assert re.fullmatch(r"[a-z][a-z0-9_]*", words[1]), line


def paths_of(node):
    """Every path of a plot below a node of the layout."""
    if isinstance(node, dict):
        if "timestampMethod" in node:
            yield node["value"]
        for value in node.values():
            yield from paths_of(value)
    elif isinstance(node, list):
        for value in node:
            yield from paths_of(value)


LAYOUT = json.loads(layout_path().read_text())


@pytest.mark.parametrize("path", list(paths_of(LAYOUT)))
def test_the_shipped_layout_plots_recorded_fields(path):
    match = re.fullmatch(r"/cycle\.(\w+)(?:\[(\d+)\])?", path)
    shape = CYCLE.dtype[match[1]].shape
    assert bool(shape) is (match[2] is not None)
    assert not shape or int(match[2]) < shape[0]


def test_the_layout_shows_arm_events_and_plots():
    text = json.dumps(LAYOUT)
    assert all(topic in LIVE_TOPICS for topic in re.findall(r'"(/[\w/]+)"', text))
    assert {"ThreeDee", "Log", "Plot"} <= set(re.findall(r'"panelType": "(\w+)"', text))
    assert len(list(paths_of(LAYOUT))) >= 10
