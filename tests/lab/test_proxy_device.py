"""The proxy device answers messages as QEMU 7.2 sends them."""

import os
import socket
import struct
import threading

import pytest

from lab.calls import PCI_ID, REGISTERS_SIZE
from lab.far.proxy_device import ProxyDevice

_HEAD = struct.Struct("<iiQ")
_MEMORY, _CONFIG_WRITE, _CONFIG_READ, _READ, _RESET = 0, 2, 3, 5, 7
_BASE = 0xC000_3000


class Emulator:
    """The emulator's end of the socket; the device answers in a thread."""

    def __init__(self):
        self.read = []
        self.link, device_socket = socket.socketpair()
        self.link.settimeout(10.0)
        self._device = ProxyDevice(device_socket, self._value)
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self.error = None
        self._device_socket = device_socket
        self._thread.start()

    def _serve(self):
        try:
            self._device.serve()
        except ValueError as error:
            self.error = error
        self._device_socket.close()

    def _value(self, offset):
        self.read.append(offset)
        return 2**64 - 1 - offset

    def ask(self, command, body=b"", piece=None):
        data = _HEAD.pack(command, 0, len(body)) + body
        for start in range(0, len(data), piece or len(data)):
            self.link.sendall(data[start : start + (piece or len(data))])
        reply = self.link.recv(24, socket.MSG_WAITALL)
        head = _HEAD.unpack_from(reply)
        assert head == (1, 0, 8)
        return int.from_bytes(reply[16:], "little")

    def config(self, offset, length, value=None):
        command = _CONFIG_READ if value is None else _CONFIG_WRITE
        return self.ask(command, struct.pack("<IIi", offset, value or 0, length))

    def read_register(self, offset, piece=None):
        body = struct.pack("<QQI?3x", _BASE + offset, 0, 8, True)
        return self.ask(_READ, body, piece)

    def end(self):
        self.link.close()
        self._thread.join(10.0)
        assert not self._thread.is_alive()


@pytest.fixture
def emulator():
    emulator = Emulator()
    yield emulator
    emulator.end()


def test_the_device_has_an_identity_and_one_page_of_registers(emulator):
    assert (emulator.config(0, 2), emulator.config(2, 2)) == PCI_ID
    for offset in (0x10, 0x14, 0x18, 0x1C, 0x20, 0x24, 0x30):
        emulator.config(offset, 4, 0xFFFF_FFFF)
    assert emulator.config(0x10, 4) == 2**32 - REGISTERS_SIZE
    assert {emulator.config(o, 4) for o in (0x14, 0x18, 0x1C, 0x20, 0x24, 0x30)} == {0}


@pytest.mark.parametrize("piece", [None, 1, 7])
def test_a_read_request_may_arrive_in_pieces(emulator, piece):
    emulator.config(0x10, 4, _BASE)
    assert emulator.read_register(8, piece) == 2**64 - 9
    assert emulator.read == [8]


def test_guest_memory_descriptors_are_closed_without_a_reply(emulator):
    read_end, write_end = os.pipe()
    data = _HEAD.pack(_MEMORY, 0, 192) + bytes(192)
    socket.send_fds(emulator.link, [data], [write_end])
    assert emulator.ask(_RESET) == 0  # the memory message had no reply
    os.close(write_end)
    assert os.read(read_end, 1) == b""  # the device closed its copy
    os.close(read_end)


def test_an_oversized_message_closes_the_connection():
    emulator = Emulator()
    emulator.link.sendall(_HEAD.pack(_READ, 0, 1 << 20))
    assert emulator.link.recv(1) == b""
    emulator.end()
    assert "1048576 bytes" in str(emulator.error)
