"""Both messages of an import agree with another library; hostile bytes are refused."""

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from analysis.logs.messages import (
    MessageError,
    read_header,
    read_joints,
    read_wrench,
)
from tests.analysis.logs.gantry import StrokeLog, messages, types_of

SHORT = StrokeLog(joint_rate=20.0, wrench_rate=20.0, with_velocity=True)


@pytest.mark.parametrize(
    ("release", "serialization"),
    [(Stores.ROS1_NOETIC, "ros1"), (Stores.ROS2_HUMBLE, "cdr")],
)
def test_messages_of_another_library_round_trip(release, serialization):
    store = get_typestore(release)
    write = store.serialize_ros1 if serialization == "ros1" else store.serialize_cdr
    for topic, _, message in messages(SHORT, store, types_of(store))[:50]:
        data = bytes(write(message, message.__msgtype__))
        stamp = message.header.stamp
        header = read_header(data, serialization)
        assert header.stamp_ns == stamp.sec * 10**9 + stamp.nanosec
        assert header.frame_id == message.header.frame_id
        if topic == "/joint_states":
            found = read_joints(data, serialization)
            assert list(found.names) == message.name
            assert list(found.position) == message.position.tolist()
            assert list(found.velocity) == message.velocity.tolist()
        else:
            force, torque = message.wrench.force, message.wrench.torque
            _, wrench = read_wrench(data, serialization)
            expected = [force.x, force.y, force.z, torque.x, torque.y, torque.z]
            assert list(wrench) == expected


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"\x12\x34",
        b"\0\1\0\0" + bytes(7),
        b"\0\1\0\0" + bytes(8) + b"\xff\xff\xff\xff",  # the frame
        b"\0\1\0\0" + bytes(12) + b"\xff\xff\xff\x0f",  # names
        b"\0\1\0\0" + bytes(16) + b"\xff\xff\xff\x0f",  # positions
        b"\0\0\0\0" + bytes(12) + b"\0\0\0\x09",
    ],
)
@pytest.mark.parametrize("serialization", ["cdr", "ros1"])
def test_an_invalid_message_is_refused(data, serialization):
    with pytest.raises(MessageError):
        read_wrench(data, serialization)
    with pytest.raises(MessageError):
        read_joints(data, serialization)


def test_big_endian_is_read():
    head = b"\0\0\0\0" + (7).to_bytes(4, "big") + bytes(4)
    head += (2).to_bytes(4, "big") + b"a\0" + bytes(2)
    values = np.arange(6.0)
    header, wrench = read_wrench(head + values.astype(">f8").tobytes(), "cdr")
    assert (header.stamp_ns, header.frame_id) == (7 * 10**9, "a")
    assert list(wrench) == values.tolist()
