"""How the guest's relay calls the host's arm: what lies where in the memory they share.

The relay writes its part, then reads a word of a PCI device whose registers the host
answers for (`far.proxy_device`). The processor that reads stands still until the
answer has come: no guest time passes in a call, however busy the host is.
"""

import mmap
import struct
from collections.abc import Sequence
from enum import IntEnum

MEMORY_SIZE = 1 << 20
PCI_ID = (0x1234, 0x7AC7)  # vendor and device that no driver of Linux knows
REGISTERS_SIZE = 4096
DONE = 1  # what a call returns; after any other value the text says what went wrong
FRAME = struct.Struct("=IB3x8s")  # struct can_frame of Linux
MOST_FRAMES = 256
_PART = struct.Struct("<qII")  # time [ns], number of frames, number of bytes
_LENGTH = struct.Struct("<I")
_ASKED_AT, _ANSWERED_AT = 0, 64
FRAMES_IN_AT, FRAMES_OUT_AT = 0x1000, 0x2000
_BYTES_IN_AT, _BYTES_OUT_AT, _TEXT_AT = 0x4000, 0x10000, 0x20000
MOST_BYTES = 0x8000

Frame = tuple[int, bytes]  # identifier, data
Memory = mmap.mmap | bytearray


class Call(IntEnum):
    """What is asked for, by the offset of the word that is read.

    ADVANCE: frames and bytes go both ways, up to a time. SERVE: begin anew with what
    the text names. DO: what a line of the text says.
    """

    ADVANCE = 0
    SERVE = 8
    DO = 16


class Exchange:
    """The shared memory; the relay asks, the host answers.

    Frames lie at `FRAMES_IN_AT` and `FRAMES_OUT_AT`, where the kernel of the guest puts
    and takes them.
    """

    def __init__(self, memory: Memory) -> None:
        self._memory = memory

    def ask(self, t_ns: int, frames: int, data: bytes) -> None:
        """Write the relay's part: the time [ns], so many frames, the line's bytes."""
        _PART.pack_into(self._memory, _ASKED_AT, t_ns, frames, len(data))
        if data:
            self._memory[_BYTES_IN_AT : _BYTES_IN_AT + len(data)] = data

    def asked(self) -> tuple[int, list[Frame], bytes]:
        """Return the relay's part.

        Raises:
            ValueError: it holds more than there is room for.
        """
        t_ns, count, size = _PART.unpack_from(self._memory, _ASKED_AT)
        if count > MOST_FRAMES or size > MOST_BYTES:
            raise ValueError(f"a call with {count} frames and {size} bytes.")
        end = FRAMES_IN_AT + count * FRAME.size
        rows = FRAME.iter_unpack(self._memory[FRAMES_IN_AT:end])
        frames = [(can_id, data[:length]) for can_id, length, data in rows]
        return t_ns, frames, bytes(self._memory[_BYTES_IN_AT : _BYTES_IN_AT + size])

    def answer(self, wake_ns: int, frames: Sequence[Frame], data: bytes) -> None:
        """Write the host's part.

        Args:
            wake_ns: when the next call is due [ns of the relay's time].
            frames: to be sent now.
            data: for the serial line.

        Raises:
            ValueError: there is not enough room.
        """
        if len(frames) > MOST_FRAMES or len(data) > MOST_BYTES:
            raise ValueError(f"an answer of {len(frames)} frames, {len(data)} bytes.")
        packed = b"".join(FRAME.pack(can_id, len(d), d) for can_id, d in frames)
        self._memory[FRAMES_OUT_AT : FRAMES_OUT_AT + len(packed)] = packed
        self._memory[_BYTES_OUT_AT : _BYTES_OUT_AT + len(data)] = data
        _PART.pack_into(self._memory, _ANSWERED_AT, wake_ns, len(frames), len(data))

    def answered(self) -> tuple[int, int, bytes]:
        """Return when to wake [ns], how many frames to send, bytes for the line."""
        wake_ns, count, size = _PART.unpack_from(self._memory, _ANSWERED_AT)
        if not size:
            return wake_ns, count, b""
        data = self._memory[_BYTES_OUT_AT : _BYTES_OUT_AT + size]
        return wake_ns, count, bytes(data)

    def say(self, text: str) -> None:
        """Write a text; one that is too long is cut."""
        start = _TEXT_AT + _LENGTH.size
        data = text.encode()[: MEMORY_SIZE - start]
        _LENGTH.pack_into(self._memory, _TEXT_AT, len(data))
        self._memory[start : start + len(data)] = data

    def message(self) -> str:
        """Return the text of the other side."""
        (length,) = _LENGTH.unpack_from(self._memory, _TEXT_AT)
        start = _TEXT_AT + _LENGTH.size
        return self._memory[start : start + length].decode(errors="replace")
