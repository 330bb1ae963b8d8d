import socket
import struct

import pytest

from acquisition.ipc.channel import LARGEST, Channel, ChannelClosedError


@pytest.fixture
def ends():
    one, other = Channel.pair()
    yield one, other
    one.close()
    other.close()


def test_a_closed_channel_is_reported(ends):
    one, other = ends
    other.close()
    with pytest.raises(ChannelClosedError):
        one.receive()
    with pytest.raises(ChannelClosedError):
        one.send("x")


@pytest.mark.parametrize(
    "raw",
    [
        struct.pack("<I", LARGEST + 1),
        struct.pack("<I", 3) + b"{{{",
        struct.pack("<I", 10) + b"cut",
    ],
)
def test_invalid_data_close_the_channel(raw):
    one, other = socket.socketpair()
    with one, other:
        one.sendall(raw)
        one.shutdown(socket.SHUT_WR)
        with pytest.raises(ChannelClosedError):
            Channel(other).receive()


def test_large_values_are_carried_whole(ends):
    import threading

    one, other = ends
    value = "x" * 3_000_000
    sender = threading.Thread(target=one.send, args=(value,))
    sender.start()
    assert other.receive() == value
    sender.join()
