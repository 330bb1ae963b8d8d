"""Corrects how the guest programs its timer, through QEMU's debugger port.

The kernel measures its local timer against its time stamp counter, and then "corrects"
the result by the ACPI timer, which does not know that guest time is slower: every
timer would expire `SLOWNESS` times too early and be set anew, a few dozen times for one
sleep. Times come out right all the same, but the host works for nothing.
"""

import contextlib
import re
import socket
import struct
from pathlib import Path

from acquisition import NS_PER_S, SystemClock
from lab.requirements import LabError

_MULT_AT = 48  # of struct clock_event_device: its ticks per ns, a u32
_LARGEST = 2**32 - 1
_PATIENCE = 30.0  # s
_ANSWER = re.compile(rb"\$([^#]*)#..")
_CLOCK = SystemClock()


def packet(text: str) -> bytes:
    """Return a command of the debugger's protocol with its checksum."""
    return f"${text}#{sum(text.encode()) % 256:02x}".encode()


class Debugger:
    """The memory of a machine; it stands still while this is open."""

    def __init__(self, path: Path) -> None:
        self._socket = socket.socket(socket.AF_UNIX)
        self._socket.settimeout(_PATIENCE)
        self._socket.connect(str(path))
        self._received = b""

    def read(self, address: int, size: int) -> bytes:
        """Return `size` bytes at a virtual address."""
        answer = self._ask(f"m{address:x},{size:x}")
        return bytes.fromhex(answer)

    def write(self, address: int, data: bytes) -> None:
        """Write bytes at a virtual address."""
        answer = self._ask(f"M{address:x},{len(data):x}:{data.hex()}")
        if answer != "OK":
            raise LabError(f"the machine's memory was not written: {answer}.")

    def close(self) -> None:
        """Let the machine go on."""
        with self._socket, contextlib.suppress(OSError):
            self._ask("D")

    def _ask(self, text: str) -> str:
        """Return the answer to a command; reports of a stop come unasked."""
        self._socket.sendall(packet(text))
        end_ns = _CLOCK.now_ns() + int(_PATIENCE * NS_PER_S)
        while _CLOCK.now_ns() < end_ns:
            while match := _ANSWER.search(self._received):
                self._received = self._received[match.end() :]
                self._socket.sendall(b"+")
                answer = match[1].decode()
                if not answer.startswith("T"):
                    return answer
            self._received += self._socket.recv(4096)
        raise LabError("the machine's debugger port does not answer.")


def correct(path: Path, offsets: int, events: int, slowness: int) -> tuple[int, int]:
    """Let timers expire in guest time; return ticks per ns before and after, scaled.

    Args:
        path: socket of the debugger port.
        offsets: address of the kernel's `__per_cpu_offset`.
        events: that of its `lapic_events`, within the part of a processor.
        slowness: how much slower guest time passes than the processor's.

    Raises:
        LabError: the memory does not look as expected.
    """
    debugger = Debugger(path)
    try:
        (offset,) = struct.unpack("<Q", debugger.read(offsets, 8))
        address = (offset + events + _MULT_AT) % 2**64
        (before,) = struct.unpack("<I", debugger.read(address, 4))
        after = before * slowness
        if not 0 < after <= _LARGEST:
            raise LabError(f"the kernel's timer counts {before}: not understood.")
        debugger.write(address, struct.pack("<I", after))
    finally:
        debugger.close()
    return before, after
