"""The remote end of QEMU's `x-pci-proxy-dev`: a PCI device with one page of registers.

Each access to the device is a message on a Unix socket, and the emulated processor
waits for the answer. A message has a header of command and size, then a body of that
size; the answer is a word of 8 bytes (docs/system/multi-process.rst of QEMU).
"""

import os
import socket
import struct
from collections.abc import Callable
from enum import IntEnum

from lab.calls import PCI_ID, REGISTERS_SIZE

_HEAD = struct.Struct("<iiQ")  # command, padding, size
_CONFIG = struct.Struct("<IIi")  # offset, value, length
_ACCESS = struct.Struct("<QQI")  # address, value, length; then a flag: memory or I/O
_WORD = struct.Struct("<Q")
_MAX_MESSAGE = 4096  # bytes
_MAX_DESCRIPTORS = 8
_CONFIG_SIZE = 256
_CLASS_AT, _REGISTERS_AT, _SUBSYSTEM_AT = 0x08, 0x10, 0x2C
_UNUSED_REGISTERS = {0x14, 0x18, 0x1C, 0x20, 0x24, 0x30}  # base addresses 1 to 5, ROM
_OTHER_PERIPHERAL = 0x0880_0001  # class and revision


class _Command(IntEnum):
    MEMORY = 0  # descriptors of the guest's memory; not answered
    ANSWER = 1
    CONFIG_WRITE = 2
    CONFIG_READ = 3
    WRITE = 4
    READ = 5
    INTERRUPT = 6  # descriptors of interrupts; not answered
    RESET = 7


_UNANSWERED = {_Command.MEMORY, _Command.INTERRUPT}


class ProxyDevice:
    """Answers the emulator's accesses until it closes the connection."""

    def __init__(self, link: socket.socket, read: Callable[[int], int]) -> None:
        """Use socket `link`; `read` returns the register at an offset."""
        self._link = link
        self._read = read
        self._address = 0  # base address of the registers
        self._config = bytearray(_CONFIG_SIZE)
        struct.pack_into("<HH", self._config, 0, *PCI_ID)
        struct.pack_into("<I", self._config, _CLASS_AT, _OTHER_PERIPHERAL)
        struct.pack_into("<HH", self._config, _SUBSYSTEM_AT, *PCI_ID)

    def serve(self) -> None:
        """Answer every message; return when the emulator closes the connection.

        Raises:
            ValueError: a message is of another version of the protocol.
        """
        while (head := self._receive(_HEAD.size)) is not None:
            command, _, size = _HEAD.unpack(head)
            if size > _MAX_MESSAGE:
                raise ValueError(f"the emulator sent a message of {size} bytes.")
            body = self._receive(size) if size else b""
            if body is None:
                return
            value = self._value(_Command(command), body)
            if command not in _UNANSWERED:
                answer = _HEAD.pack(_Command.ANSWER, 0, _WORD.size)
                self._link.sendall(answer + _WORD.pack(value))

    def _receive(self, size: int) -> bytes | None:
        """Return the next bytes, None at the end; close any descriptors sent along."""
        data = b""
        while len(data) < size:
            part, descriptors, _, _ = socket.recv_fds(
                self._link, size - len(data), _MAX_DESCRIPTORS
            )
            for descriptor in descriptors:
                os.close(descriptor)
            if not part:
                return None
            data += part
        return data

    def _value(self, command: _Command, body: bytes) -> int:
        """Execute a message; return the value of the answer."""
        if command is _Command.READ:
            address, _, _ = _ACCESS.unpack_from(body)
            return self._read(address - self._address)
        if command is _Command.CONFIG_READ:
            offset, _, length = _CONFIG.unpack_from(body)
            return int.from_bytes(self._config[offset : offset + length], "little")
        if command is _Command.CONFIG_WRITE:
            self._configure(*_CONFIG.unpack_from(body))
        return 0

    def _configure(self, offset: int, value: int, length: int) -> None:
        if offset in _UNUSED_REGISTERS:
            return
        if offset == _REGISTERS_AT:  # the low bits are fixed at 0, which gives the size
            value &= ~(REGISTERS_SIZE - 1)
            self._address = value & 0xFFFF_FFFF
        data = (value & (1 << 8 * length) - 1).to_bytes(length, "little")
        self._config[offset : offset + length] = data
