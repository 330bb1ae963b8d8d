"""Sets the true rate of the local timer in the guest's kernel through QEMU's gdb stub.

The kernel's time passes `SLOWNESS` times slower than the timer counts. The kernel
calibrates the timer against clocks that are not slowed, so each interrupt comes after a
sixth of the remaining wait, and some thirty interrupts replace one.
"""

import socket
import struct
from dataclasses import dataclass
from pathlib import Path

_PATIENCE = 30.0  # s of the host
_POINTER = struct.Struct("<Q")
# struct clock_event_device of Linux: three functions, the next event, then longest and
# shortest wait [ns], factor and its shift.
_RATE = struct.Struct("<32x QQ II")
_LONGEST_AT, _FACTOR_AT = 32, 48
_SHIFT = 32
_MASK = 2**64 - 1


class DebuggerError(Exception):
    """The stub does not answer, or the kernel is not the expected one."""


@dataclass(frozen=True, slots=True)
class Rate:
    """Conversion of a clock event device from nanoseconds to counts.

    Attributes:
        longest: longest wait [ns].
        factor: counts per nanosecond, times 2 ** shift.
        shift: binary exponent of the factor.
    """

    longest: int
    factor: int
    shift: int

    def slowed(self, slowness: int) -> "Rate":
        """Return the rate for a kernel whose time passes `slowness` times slower.

        Raises:
            DebuggerError: this is not the local timer, or the factor overflows.
        """
        factor = self.factor * slowness
        if self.shift != _SHIFT or not 0 < self.factor < factor < 2**32:
            raise DebuggerError(f"the kernel's local timer is not as expected: {self}.")
        return Rate(self.longest // slowness, factor, self.shift)


class Debugger:
    """A connection to the stub; the machine is stopped while it is open."""

    def __init__(self, path: Path) -> None:
        """Connect; raises OSError."""
        self._link = socket.socket(socket.AF_UNIX)
        self._link.settimeout(_PATIENCE)
        self._link.connect(str(path))
        self._bytes = b""

    def __enter__(self) -> "Debugger":
        return self

    def __exit__(self, *_: object) -> None:
        with self._link:
            self._ask("D")  # detach: the machine continues

    def read(self, address: int, size: int) -> bytes:
        """Return memory at a virtual address; raises DebuggerError."""
        answer = self._ask(f"m{address:x},{size:x}")
        try:
            return bytes.fromhex(answer)
        except ValueError:
            raise DebuggerError(f"the stub answered {answer!r}.") from None

    def write(self, address: int, data: bytes) -> None:
        """Write memory at a virtual address; raises DebuggerError."""
        answer = self._ask(f"M{address:x},{len(data):x}:{data.hex()}")
        if answer != "OK":
            raise DebuggerError(f"the stub answered {answer!r}.")

    def _ask(self, text: str) -> str:
        """Send a packet; return the answer; raises DebuggerError without one."""
        data = text.encode()
        self._link.sendall(b"$%s#%02x" % (data, sum(data) % 256))
        while True:
            answer = self._packet()
            if not answer.startswith("T"):  # unsolicited report of a stop
                return answer

    def _packet(self) -> str:
        while (end := self._bytes.find(b"#")) < 0 or len(self._bytes) < end + 3:
            try:
                more = self._link.recv(4096)
            except OSError as error:
                raise DebuggerError(f"the stub is silent: {error}.") from None
            if not more:
                raise DebuggerError("the stub has hung up.")
            self._bytes += more
        start = self._bytes.index(b"$") + 1
        text, self._bytes = self._bytes[start:end], self._bytes[end + 3 :]
        self._link.sendall(b"+")
        return text.decode("ascii", "replace")


def correct(path: Path, events: int, offsets: int, slowness: int) -> None:
    """Correct the rate of the first processor's local timer for the kernel's time.

    Args:
        path: path of the stub's socket.
        events: the kernel's symbol `lapic_events`, relative to a per-processor area.
        offsets: the kernel's symbol `__per_cpu_offset`, the table of these areas.
        slowness: counting rate of the timer over that of the kernel's time.

    Raises:
        DebuggerError: the kernel is not the expected one.
        OSError: there is no stub.
    """
    with Debugger(path) as debugger:
        (area,) = _POINTER.unpack(debugger.read(offsets, _POINTER.size))
        device = (area + events) & _MASK
        longest, _, factor, shift = _RATE.unpack(debugger.read(device, _RATE.size))
        rate = Rate(longest, factor, shift).slowed(slowness)
        debugger.write(device + _LONGEST_AT, _POINTER.pack(rate.longest))
        debugger.write(device + _FACTOR_AT, struct.pack("<I", rate.factor))
