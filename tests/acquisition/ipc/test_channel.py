import socket
import struct

import pytest

from acquisition.ipc.channel import LARGEST, Channel, ChannelClosedError


@pytest.fixture
def ends():
    first, second = Channel.pair()
    yield first, second
    first.close()
    second.close()


def test_a_closed_channel_is_reported(ends):
    first, second = ends
    second.close()
    with pytest.raises(ChannelClosedError):
        first.receive()
    with pytest.raises(ChannelClosedError):
        first.send("x")


@pytest.mark.parametrize(
    "raw",
    [
        struct.pack("<I", LARGEST + 1),
        struct.pack("<I", 3) + b"{{{",
        struct.pack("<I", 10) + b"cut",
    ],
)
def test_invalid_data_close_the_channel(raw):
    first, second = socket.socketpair()
    with first, second:
        first.sendall(raw)
        first.shutdown(socket.SHUT_WR)
        with pytest.raises(ChannelClosedError):
            Channel(second).receive()


def test_large_values_are_carried_whole(ends):
    import threading

    first, second = ends
    value = "x" * 3_000_000
    sender = threading.Thread(target=first.send, args=(value,))
    sender.start()
    assert second.receive() == value
    sender.join()
