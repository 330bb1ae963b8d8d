"""Calls from the guest's relay to the host's arm: layout of the shared memory.

The relay writes its request, then reads a register of a PCI device that the host
implements (`far.proxy_device`). The emulated processor stalls until the answer arrives,
so no guest time passes during a call, however busy the host is.
"""

import mmap
import struct
from collections.abc import Sequence
from enum import IntEnum

MEMORY_SIZE = 1 << 20
PCI_ID = (0x1234, 0x7AC7)  # vendor and device number, unknown to Linux drivers
REGISTERS_SIZE = 4096
DONE = 1  # return value of a successful call; otherwise the text holds the error
FRAME = struct.Struct("=IB3x8s")  # struct can_frame of Linux
MAX_FRAMES = 256
_PART = struct.Struct("<qII")  # time [ns], number of frames, number of bytes
_LENGTH = struct.Struct("<I")
_ASKED_AT, _ANSWERED_AT = 0, 64
FRAMES_IN_AT, FRAMES_OUT_AT = 0x1000, 0x2000
_BYTES_IN_AT, _BYTES_OUT_AT, _TEXT_AT = 0x4000, 0x10000, 0x20000
MAX_BYTES = 0x8000

Frame = tuple[int, bytes]  # identifier, data
Memory = mmap.mmap | bytearray


class Call(IntEnum):
    """Kind of call, by the offset of the register that is read.

    ADVANCE: exchange frames and bytes and simulate up to a time. SERVE: start the
    device described by the text. DO: carry out the command in the text.
    """

    ADVANCE = 0
    SERVE = 8
    DO = 16


class Exchange:
    """The shared memory: requests of the relay, answers of the host.

    The guest's kernel writes received frames directly to `FRAMES_IN_AT` and reads
    frames to send from `FRAMES_OUT_AT`.
    """

    def __init__(self, memory: Memory) -> None:
        self._memory = memory

    def ask(self, t_ns: int, frames: int, data: bytes) -> None:
        """Write the request: time [ns], number of frames, bytes of the serial line."""
        _PART.pack_into(self._memory, _ASKED_AT, t_ns, frames, len(data))
        if data:
            self._memory[_BYTES_IN_AT : _BYTES_IN_AT + len(data)] = data

    def asked(self) -> tuple[int, list[Frame], bytes]:
        """Return the request: time [ns], frames, bytes of the serial line.

        Raises:
            ValueError: it exceeds the size of the memory.
        """
        t_ns, count, size = _PART.unpack_from(self._memory, _ASKED_AT)
        if count > MAX_FRAMES or size > MAX_BYTES:
            raise ValueError(f"a call with {count} frames and {size} bytes.")
        end = FRAMES_IN_AT + count * FRAME.size
        rows = FRAME.iter_unpack(self._memory[FRAMES_IN_AT:end])
        frames = [(can_id, data[:length]) for can_id, length, data in rows]
        return t_ns, frames, bytes(self._memory[_BYTES_IN_AT : _BYTES_IN_AT + size])

    def answer(self, wake_ns: int, frames: Sequence[Frame], data: bytes) -> None:
        """Write the answer of the host.

        Args:
            wake_ns: when the next call is due [ns of the relay's time].
            frames: frames to send now.
            data: bytes for the serial line.

        Raises:
            ValueError: it exceeds the size of the memory.
        """
        if len(frames) > MAX_FRAMES or len(data) > MAX_BYTES:
            raise ValueError(f"an answer of {len(frames)} frames, {len(data)} bytes.")
        packed = b"".join(FRAME.pack(can_id, len(d), d) for can_id, d in frames)
        self._memory[FRAMES_OUT_AT : FRAMES_OUT_AT + len(packed)] = packed
        self._memory[_BYTES_OUT_AT : _BYTES_OUT_AT + len(data)] = data
        _PART.pack_into(self._memory, _ANSWERED_AT, wake_ns, len(frames), len(data))

    def answered(self) -> tuple[int, int, bytes]:
        """Return the answer: wake-up time [ns], number of frames to send, bytes."""
        wake_ns, count, size = _PART.unpack_from(self._memory, _ANSWERED_AT)
        if not size:
            return wake_ns, count, b""
        data = self._memory[_BYTES_OUT_AT : _BYTES_OUT_AT + size]
        return wake_ns, count, bytes(data)

    def say(self, text: str) -> None:
        """Write a text, truncated if too long."""
        start = _TEXT_AT + _LENGTH.size
        data = text.encode()[: MEMORY_SIZE - start]
        _LENGTH.pack_into(self._memory, _TEXT_AT, len(data))
        self._memory[start : start + len(data)] = data

    def message(self) -> str:
        """Return the text written by the other side."""
        (length,) = _LENGTH.unpack_from(self._memory, _TEXT_AT)
        start = _TEXT_AT + _LENGTH.size
        return self._memory[start : start + length].decode(errors="replace")
