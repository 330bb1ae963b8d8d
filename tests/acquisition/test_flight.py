import struct

import pytest

from acquisition.flight import FrameTape, RawFrame, encode_can_batch
from tests.acquisition.ros import decode

S = 1_000_000_000


def test_the_tape_keeps_the_last_two_seconds():
    tape = FrameTape()
    for t_ns in (0, S, 3 * S - 1, 3 * S, 5 * S):
        tape.add(t_ns, 1, b"")
    assert [frame.t_ns for frame in tape.last()] == [3 * S, 5 * S]


def test_the_span_can_be_chosen():
    tape = FrameTape()
    for t_ns in (0, S, 2 * S):
        tape.add(t_ns, 1, b"")
    assert [frame.t_ns for frame in tape.last(1.0)] == [S, 2 * S]


def test_an_empty_tape_gives_nothing():
    assert FrameTape().last() == []


def test_the_tape_does_not_grow():
    tape = FrameTape(frames=5)
    for t_ns in range(50):
        tape.add(t_ns, 1, b"")
    assert [frame.t_ns for frame in tape.last()] == [45, 46, 47, 48, 49]


@pytest.mark.parametrize("size", range(9))
def test_a_frame_is_sixteen_bytes_as_linux_has_it(size):
    data = bytes(range(1, size + 1))
    payload = encode_can_batch(0, [RawFrame(7, 0x403, data)])
    batch = decode("traction_msgs/msg/CanBatch", payload)
    raw = batch.frames.tobytes()
    assert len(raw) == 16
    can_id, length = struct.unpack_from("<IB", raw)
    assert (can_id, length, raw[5:8]) == (0x403, size, bytes(3))
    assert raw[8:] == data.ljust(8, b"\0")


def test_frames_and_times_go_together():
    frames = [RawFrame(10 + i, i, bytes([i])) for i in range(5)]
    batch = decode("traction_msgs/msg/CanBatch", encode_can_batch(3, frames))
    assert batch.t_ns.tolist() == [10, 11, 12, 13, 14]
    assert batch.frames.reshape(5, 16)[:, 8].tolist() == [0, 1, 2, 3, 4]
    assert batch.header.frame_id == "can"


def test_a_batch_without_frames_is_a_message_too():
    batch = decode("traction_msgs/msg/CanBatch", encode_can_batch(0, []))
    assert (len(batch.t_ns), len(batch.frames)) == (0, 0)
