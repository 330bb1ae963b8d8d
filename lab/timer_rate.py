"""Corrects how the guest programs its timer, through QEMU's debugger port.

The kernel measures its local timer against its time stamp counter, and then "corrects"
the result by the ACPI timer, which does not know that guest time is slower: every
timer would expire `SLOWNESS` times too early and be set anew, a few dozen times for one
sleep. Times come out right all the same, but the host works for nothing. A kernel that
has been booted before is told the rate and does not measure: that alone takes half of
its start.
"""

import contextlib
import re
import socket
import struct
from pathlib import Path

from acquisition.clock import NS_PER_S, SystemClock
from lab.requirements import LabError
from lab.results import TimerAddresses

_MULT_AT = 48  # of struct clock_event_device: its ticks per ns, a u32
_LARGEST = 2**32 - 1
_BUS_HZ = 1_000_000_000  # of the emulated local timer
_KERNEL_HZ = 250  # periodic ticks of Debian's kernel
_PATIENCE = 30.0  # s
_BOOTING = 300.0  # s until a busy host has come to the kernel's timers
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

    def run_to(self, address: int) -> None:
        """Let the machine go on until it is about to execute a virtual address."""
        self._ask(f"Z1,{address:x},1")
        self._socket.sendall(packet("c"))
        self._socket.settimeout(_BOOTING)
        while not self._next_answer().startswith("T"):
            pass
        self._socket.settimeout(_PATIENCE)
        self._ask(f"z1,{address:x},1")

    def close(self) -> None:
        """Let the machine go on."""
        with self._socket, contextlib.suppress(OSError):
            self._ask("D")

    def _ask(self, text: str) -> str:
        """Return the answer to a command; reports of a stop come unasked."""
        self._socket.sendall(packet(text))
        end_ns = _CLOCK.now_ns() + int(_PATIENCE * NS_PER_S)
        while _CLOCK.now_ns() < end_ns:
            if not (answer := self._next_answer()).startswith("T"):
                return answer
        raise LabError("the machine's debugger port does not answer.")

    def _next_answer(self) -> str:
        """Return the next packet, whatever it is."""
        while (match := _ANSWER.search(self._received)) is None:
            data = self._socket.recv(4096)
            if not data:
                raise LabError("the machine has ended before its timers were set up.")
            self._received += data
        self._received = self._received[match.end() :]
        self._socket.sendall(b"+")
        return match[1].decode()


def preset(path: Path, addresses: TimerAddresses, slowness: int) -> None:
    """Start a machine that waits, and tell its kernel the rate of its timer.

    Args:
        path: socket of the debugger port.
        addresses: where an earlier start of this kernel had them.
        slowness: how much slower guest time passes than the processor's.

    Raises:
        LabError: the machine does not come to its timers.
    """
    debugger = Debugger(path)
    try:
        debugger.run_to(addresses.setup)
        ticks = struct.pack("<I", _BUS_HZ * slowness // _KERNEL_HZ)
        debugger.write(addresses.period, ticks)
    finally:
        debugger.close()


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
