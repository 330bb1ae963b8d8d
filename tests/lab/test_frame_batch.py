"""The relay moves frames between a socket and shared memory."""

import ctypes
import socket

import pytest

from lab.calls import FRAME, FRAMES_OUT_AT, MAX_FRAMES, MEMORY_SIZE, Exchange
from lab.guest.frame_batch import FrameBatch

FRAMES = [(0x0A0 + number, bytes(range(number))) for number in range(9)]


@pytest.fixture
def ends():
    here, there = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    there.setblocking(False)
    with here, there:
        yield here, there


@pytest.fixture
def memory():
    return bytearray(MEMORY_SIZE)


@pytest.fixture
def batch(ends, memory):
    return FrameBatch(ends[0], (ctypes.c_char * MEMORY_SIZE).from_buffer(memory))


def test_all_waiting_frames_are_received_in_one_call(ends, memory, batch):
    for can_id, data in FRAMES:
        ends[1].send(FRAME.pack(can_id, len(data), data))
    exchange = Exchange(memory)
    exchange.ask(7, batch.receive(), b"")
    assert exchange.asked() == (7, FRAMES, b"")
    assert batch.receive() == 0


def test_all_frames_of_an_answer_are_sent_in_order(ends, memory, batch):
    Exchange(memory).answer(9, FRAMES, b"abc")
    assert Exchange(memory).answered() == (9, len(FRAMES), b"abc")
    batch.send(len(FRAMES))
    taken = [FRAME.unpack(ends[1].recv(64)) for _ in FRAMES]
    assert [(can_id, data[:length]) for can_id, length, data in taken] == FRAMES
    assert batch.lost == 0


def test_frames_refused_by_the_bus_are_counted(ends, memory, batch):
    memory[FRAMES_OUT_AT : FRAMES_OUT_AT + FRAME.size] = FRAME.pack(1, 0, b"")
    ends[0].setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1)
    for _ in range(20):
        batch.send(MAX_FRAMES)
    assert batch.lost > 0


def test_a_closed_bus_is_an_error(ends, batch):
    ends[1].close()
    with pytest.raises(OSError, match="can: "):
        batch.send(1)
