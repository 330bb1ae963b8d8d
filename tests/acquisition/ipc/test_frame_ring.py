import struct

import pytest

from acquisition.ipc.frame_ring import FRAME_DTYPE, FrameRing, last_frames
from acquisition.ipc.ring_buffer import RingBuffer
from acquisition.trial_file.views import encode_can_batch
from tests.acquisition.ros import decode
from tests.fakes.stepped import SteppedClock

S = 1_000_000_000


@pytest.fixture
def buffer():
    size = RingBuffer.size_of(FRAME_DTYPE, 6)
    return RingBuffer(memoryview(bytearray(size)), FRAME_DTYPE, 6)


def clock_at(t_ns):
    clock = SteppedClock()
    clock.t_ns = t_ns
    return clock


def fill_ring(buffer, times_ns):
    ring = FrameRing(buffer, clock_at(0))
    ring.add((1, b"", t_ns) for t_ns in times_ns)


def times(frames):
    return frames["t_ns"].tolist()


def test_the_default_span_is_returned(buffer):
    fill_ring(buffer, (0, S, 3 * S - 1, 3 * S, 5 * S))
    assert times(last_frames(buffer)) == [3 * S, 5 * S]


def test_the_span_can_be_chosen(buffer):
    fill_ring(buffer, (0, S, 2 * S))
    assert times(last_frames(buffer, 1.0)) == [S, 2 * S]


def test_frames_without_a_time_get_the_present_in_arrival_order(buffer):
    frames = [(0x423, b"\x01\x02\x03", S - 9), (0x443, b"", 0), (1, bytes(8), 8)]
    FrameRing(buffer, clock_at(S)).add(frames)
    kept = buffer.last(5)
    assert kept["can_id"].tolist() == [0x423, 0x443, 1]
    assert kept["length"].tolist() == [3, 0, 8]
    assert times(kept) == [S - 9, S, 8]


def test_an_empty_ring_gives_no_frames(buffer):
    assert len(last_frames(buffer)) == 0


def test_the_ring_does_not_grow(buffer):
    fill_ring(buffer, range(50))
    assert times(last_frames(buffer)) == [45, 46, 47, 48, 49]


def test_a_frame_replaces_all_of_the_one_before(buffer):
    for _ in range(6):
        buffer.write(b"\xff" * FRAME_DTYPE.itemsize)
    FrameRing(buffer, clock_at(7)).add([(0x404, b"\x30", 0)])
    assert buffer.last(1).tobytes() == struct.pack("<QIB3x8s", 7, 0x404, 1, b"\x30")


def frames_of(*frames):
    buffer = RingBuffer(
        memoryview(bytearray(RingBuffer.size_of(FRAME_DTYPE, 9))), FRAME_DTYPE, 9
    )
    ring = FrameRing(buffer, clock_at(0))
    ring.add((can_id, data, t_ns) for t_ns, can_id, data in frames)
    return buffer.last(9)


@pytest.mark.parametrize("size", range(9))
def test_a_frame_has_the_can_layout_of_linux(size):
    data = bytes(range(1, size + 1))
    payload = encode_can_batch(0, frames_of((7, 0x403, data)))
    batch = decode("traction_msgs/msg/CanBatch", payload)
    raw = batch.frames.tobytes()
    assert len(raw) == 16
    can_id, length = struct.unpack_from("<IB", raw)
    assert (can_id, length, raw[5:8]) == (0x403, size, bytes(3))
    assert raw[8:] == data.ljust(8, b"\0")


def test_frames_and_times_go_together():
    frames = frames_of(*((10 + i, i, bytes([i])) for i in range(5)))
    batch = decode("traction_msgs/msg/CanBatch", encode_can_batch(3, frames))
    assert batch.t_ns.tolist() == [10, 11, 12, 13, 14]
    assert batch.frames.reshape(5, 16)[:, 8].tolist() == [0, 1, 2, 3, 4]
    assert batch.header.frame_id == "can"


def test_a_batch_without_frames_is_a_valid_message():
    batch = decode("traction_msgs/msg/CanBatch", encode_can_batch(0, frames_of()))
    assert (len(batch.t_ns), len(batch.frames)) == (0, 0)
