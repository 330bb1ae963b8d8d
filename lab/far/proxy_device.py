"""The remote end of QEMU's `x-pci-proxy-dev`: a PCI device with one page of registers.

Each access to the device is a message on a Unix socket, and the emulated processor
waits for its answer. A message is a head of command and size, then as many bytes; an
answer is a word of 8 bytes (docs/system/multi-process.rst of QEMU).
"""

import os
import socket
import struct
from collections.abc import Callable
from enum import IntEnum

from lab.calls import PCI_ID, REGISTERS_SIZE

_HEAD = struct.Struct("<iiQ")  # command, padding, size
_CONFIG = struct.Struct("<IIi")  # offset, value, length
_ACCESS = struct.Struct("<QQI")  # address, value, length; then whether it is memory
_WORD = struct.Struct("<Q")
_LONGEST = 4096  # bytes of a message
_MOST_DESCRIPTORS = 8
_CONFIG_SIZE = 256
_CLASS_AT, _REGISTERS_AT, _SUBSYSTEM_AT = 0x08, 0x10, 0x2C
_OTHER_REGISTERS = {0x14, 0x18, 0x1C, 0x20, 0x24, 0x30}  # and a ROM: there are none
_OTHER_PERIPHERAL = 0x0880_0001  # class and revision


class _Command(IntEnum):
    MEMORY = 0  # where the guest's memory is, as descriptors: unanswered
    ANSWER = 1
    CONFIG_WRITE = 2
    CONFIG_READ = 3
    WRITE = 4
    READ = 5
    INTERRUPT = 6  # descriptors of interrupts: unanswered
    RESET = 7


_UNANSWERED = {_Command.MEMORY, _Command.INTERRUPT}


class ProxyDevice:
    """Answers the emulator until it hangs up."""

    def __init__(self, link: socket.socket, read: Callable[[int], int]) -> None:
        """Answer over `link`; `read`: value of the word at an offset."""
        self._link = link
        self._read = read
        self._address = 0  # of the registers
        self._config = bytearray(_CONFIG_SIZE)
        struct.pack_into("<HH", self._config, 0, *PCI_ID)
        struct.pack_into("<I", self._config, _CLASS_AT, _OTHER_PERIPHERAL)
        struct.pack_into("<HH", self._config, _SUBSYSTEM_AT, *PCI_ID)

    def serve(self) -> None:
        """Answer every message; return when the emulator has hung up.

        Raises:
            ValueError: a message is of another version of the protocol.
        """
        while (head := self._taken(_HEAD.size)) is not None:
            command, _, size = _HEAD.unpack(head)
            if size > _LONGEST:
                raise ValueError(f"the emulator sent a message of {size} bytes.")
            body = self._taken(size) if size else b""
            if body is None:
                return
            value = self._value(_Command(command), body)
            if command not in _UNANSWERED:
                answer = _HEAD.pack(_Command.ANSWER, 0, _WORD.size)
                self._link.sendall(answer + _WORD.pack(value))

    def _taken(self, size: int) -> bytes | None:
        """Return the next bytes, None at the end; descriptors are not wanted."""
        data = b""
        while len(data) < size:
            part, descriptors, _, _ = socket.recv_fds(
                self._link, size - len(data), _MOST_DESCRIPTORS
            )
            for descriptor in descriptors:
                os.close(descriptor)
            if not part:
                return None
            data += part
        return data

    def _value(self, command: _Command, body: bytes) -> int:
        """Do what a message says; return what is answered."""
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
        if offset in _OTHER_REGISTERS:
            return
        if offset == _REGISTERS_AT:  # the bits of its size are not there
            value &= ~(REGISTERS_SIZE - 1)
            self._address = value & 0xFFFF_FFFF
        data = (value & (1 << 8 * length) - 1).to_bytes(length, "little")
        self._config[offset : offset + length] = data
