import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.cdr import CdrWriter, encode_log, encode_string
from acquisition.schema import CYCLE
from acquisition.trial_file.views import JOINT_NAMES, encode_views
from tests.acquisition.ros import decode, encode

STAMP_NS = 1_700_000_000_000_000_001
VIEWS = {
    "/joint_states": "sensor_msgs/msg/JointState",
    "/wrench": "geometry_msgs/msg/WrenchStamped",
    "/foot/pose": "geometry_msgs/msg/PoseStamped",
    "/foot/twist": "geometry_msgs/msg/TwistStamped",
}
texts = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"))
doubles = st.lists(st.floats(width=64, allow_nan=False), max_size=9)


@pytest.fixture(scope="module")
def record():
    row = np.frombuffer(bytearray(CYCLE.template), CYCLE.dtype)
    rng = np.random.default_rng(0)
    for name in ("position", "velocity", "torque_command", "wrench"):
        row[name] = rng.normal(size=row[name].shape)
    row["foot_position"] = (0.1, -0.2, 0.3)
    row["foot_orientation"] = (0.5, -0.5, 0.5, 0.5)
    row["foot_velocity"] = np.arange(1.0, 7.0)
    return row[0]


@given(names=st.lists(texts, max_size=4), values=doubles, frame=texts)
def test_joint_states_of_any_length_round_trip(names, values, frame):
    array = np.array(values, np.float64)
    writer = CdrWriter().header(STAMP_NS, frame).strings(names)
    payload = writer.sequence(array).sequence(array[:1]).sequence(array).finish()
    message = decode("sensor_msgs/msg/JointState", payload)
    assert message.header.frame_id == frame
    assert list(message.name) == names
    assert message.position.tobytes() == array.tobytes()
    assert message.velocity.tobytes() == array[:1].tobytes()
    assert message.effort.tobytes() == array.tobytes()


@pytest.mark.parametrize("padding", range(8))
def test_doubles_are_padded_to_eight_after_their_count(padding):
    writer = CdrWriter().header(0, "f" * padding).strings(["a"])
    writer.sequence(np.array([1.5])).sequence(np.empty(0)).sequence(np.array([2.5]))
    message = decode("sensor_msgs/msg/JointState", writer.finish())
    assert (message.position.tolist(), message.effort.tolist()) == ([1.5], [2.5])


@given(text=texts)
def test_strings_agree_with_an_independent_writer(text):
    payload = encode_string(text)
    message = decode("std_msgs/msg/String", payload)
    assert message.data == text
    assert encode("std_msgs/msg/String", message) == payload


def test_text_that_is_not_unicode_is_encoded_with_a_replacement():
    assert decode("std_msgs/msg/String", encode_string("mark \udc80")).data == "mark ?"


@given(level=st.sampled_from([10, 20, 30, 40, 50]), name=texts, text=texts)
def test_events_round_trip(level, name, text):
    message = decode("rcl_interfaces/msg/Log", encode_log(STAMP_NS, level, name, text))
    assert (message.level, message.name, message.msg) == (level, name, text)
    assert (message.stamp.sec, message.stamp.nanosec) == (1_700_000_000, 1)
    assert (message.file, message.function, message.line) == ("", "", 0)


@pytest.mark.parametrize("topic", VIEWS)
def test_views_agree_with_an_independent_writer(record, topic):
    payload = encode_views(record, STAMP_NS)[topic]
    message = decode(VIEWS[topic], payload)
    assert encode(VIEWS[topic], message) == payload


def test_the_joint_view_repeats_the_cycle(record):
    message = decode(VIEWS["/joint_states"], encode_views(record, 0)["/joint_states"])
    assert list(message.name) == JOINT_NAMES
    assert message.position.tobytes() == record["position"].tobytes()
    assert message.velocity.tobytes() == record["velocity"].tobytes()
    assert message.effort.tobytes() == record["torque_command"].tobytes()


def test_the_wrench_view_repeats_the_cycle(record):
    message = decode(VIEWS["/wrench"], encode_views(record, 0)["/wrench"])
    force, torque = message.wrench.force, message.wrench.torque
    components = [force.x, force.y, force.z, torque.x, torque.y, torque.z]
    assert message.header.frame_id == "ft_sensor"
    assert components == record["wrench"].tolist()


def test_the_pose_view_repeats_the_cycle(record):
    pose = decode(VIEWS["/foot/pose"], encode_views(record, 0)["/foot/pose"]).pose
    at, turn = pose.position, pose.orientation
    assert [at.x, at.y, at.z] == record["foot_position"].tolist()
    assert [turn.x, turn.y, turn.z, turn.w] == record["foot_orientation"].tolist()


def test_the_twist_view_repeats_the_cycle(record):
    twist = decode(VIEWS["/foot/twist"], encode_views(record, 0)["/foot/twist"]).twist
    linear, angular = twist.linear, twist.angular
    components = [linear.x, linear.y, linear.z, angular.x, angular.y, angular.z]
    assert components == record["foot_velocity"].tolist()
