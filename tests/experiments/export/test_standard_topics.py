"""Exported standard topics hold the same numbers as `/cycle`, as read by rosbags."""

import hashlib

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from acquisition.errors import TrialFileError
from acquisition.trial_file.reader import TrialReader
from analysis.data.load import load_trial
from analysis.logs.robot import RobotLeg, parse_urdf
from tests.experiments.program import traction

TOPICS = {"/joint_states", "/wrench", "/foot/pose", "/foot/twist"}


@pytest.fixture(scope="module")
def standard(recorded, tmp_path_factory):
    to = tmp_path_factory.mktemp("standard") / "bags"
    done = traction(
        "export", "S001", "--to", to, "--standard-rate", "--data", recorded.data
    )
    assert (done.code, done.err) == (0, "")
    return to / recorded.folder.name / "T01.mcap"


def messages(path, topic):
    store = get_typestore(Stores.ROS2_HUMBLE)
    with AnyReader([path], default_typestore=store) as bag:
        chosen = [c for c in bag.connections if c.topic == topic]
        return [
            (time, bag.deserialize(raw, connection.msgtype))
            for connection, time, raw in bag.messages(chosen)
        ]


@pytest.mark.parametrize("topic", sorted(TOPICS))
def test_every_topic_has_a_message_of_every_cycle(standard, first_trial, topic):
    rows = TrialReader(first_trial).cycles()
    times = [time for time, _ in messages(standard, topic)]
    assert times == rows.log_time.tolist()


def test_messages_hold_the_numbers_of_the_cycles(standard, first_trial):
    cycles = TrialReader(first_trial).cycles().data
    joints = [message for _, message in messages(standard, "/joint_states")]
    assert np.array_equal([m.position for m in joints], cycles["position"])
    assert np.array_equal([m.effort for m in joints], cycles["torque_command"])
    wrenches = [message.wrench for _, message in messages(standard, "/wrench")]
    forces = [(w.force.x, w.force.y, w.force.z) for w in wrenches]
    assert np.array_equal(forces, cycles["wrench"][:, :3])
    poses = [message.pose for _, message in messages(standard, "/foot/pose")]
    positions = [(p.position.x, p.position.y, p.position.z) for p in poses]
    assert np.array_equal(positions, cycles["foot_position"])
    twists = [message.twist for _, message in messages(standard, "/foot/twist")]
    turns = [(t.angular.x, t.angular.y, t.angular.z) for t in twists]
    assert np.array_equal(turns, cycles["foot_velocity"][:, 3:])


def test_the_robot_has_every_frame_that_a_message_names(standard, first_trial):
    ((_, description),) = messages(standard, "/robot_description")
    robot = parse_urdf(standard, description.data.encode())
    names = {
        m.header.frame_id for topic in TOPICS for _, m in messages(standard, topic)
    }
    assert names <= {*robot.links}
    trial = load_trial(first_trial)
    leg = RobotLeg(robot, "sole", "ft_sensor")
    q = np.array(trial.cycles["position"][::100])
    path = leg.along(q, np.zeros_like(q))
    assert path.foot == pytest.approx(trial.sole[::100], abs=1e-9)
    turned = trial.rotation[::100] @ trial.payload.rotation
    assert path.sensor == pytest.approx(turned, abs=1e-9)


def test_a_bag_holds_standard_types_only(standard):
    with AnyReader([standard]) as bag:
        topics = {c.topic: c.msgtype for c in bag.connections}
    assert set(topics) == {*TOPICS, "/robot_description"}
    assert not any("traction" in name for name in topics.values())


def test_metadata_state_simulation_and_source_recording(standard, first_trial):
    from mcap.reader import make_reader

    with standard.open("rb") as file:
        metadata = {m.name: m.metadata for m in make_reader(file).iter_metadata()}
    with standard.open("rb") as file:
        names = {a.name for a in make_reader(file).iter_attachments()}
    assert metadata["recording"]["simulated"] == "true"
    digest = hashlib.sha256(first_trial.read_bytes()).hexdigest()
    assert metadata["recording"]["sha256"] == digest
    assert {"terrain.toml", "ft_calibration.toml", "robot.urdf"} <= names


def test_a_bag_is_not_read_as_a_trial(standard):
    with pytest.raises(TrialFileError, match=r"no trial of Traction.*/joint_states"):
        TrialReader(standard)


@pytest.mark.parametrize(
    "options",
    [
        ("S001", "--terrain-db", "x.json", "--standard-rate"),
        ("S001", "--to", "x", "--standard-rate", "--format", "csv"),
    ],
)
def test_mixed_use_is_refused(recorded, tmp_path, monkeypatch, options):
    monkeypatch.chdir(tmp_path)
    done = traction("export", *options, "--data", recorded.data)
    assert done.code == 2
    assert "--standard-rate" in done.err
    assert not list(tmp_path.iterdir())
