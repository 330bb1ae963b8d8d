"""Joins the far ends of bus and serial line to the host's arm: `relay --config FILE`.

Lines on stdin go to what is served (lab.far.pushed_arm, lab.far.line_sensor), in time
with everything else; "quit" ends the relay.
"""

import argparse
import contextlib
import ctypes
import json
import mmap
import os
import select
import sys
from pathlib import Path

from acquisition.clock import NS_PER_S, SystemClock
from experiments.operator.pendant import Lines
from lab.calls import (
    DONE,
    MEMORY_SIZE,
    MOST_BYTES,
    PCI_ID,
    REGISTERS_SIZE,
    Call,
    Exchange,
)
from lab.guest.frame_batch import FrameBatch, open_can

_DEVICES = Path("/sys/bus/pci/devices")
_SHARED_MEMORY = (0x1AF4, 0x1110)  # vendor and device of ivshmem
_AT_ONCE = 4096
_FRICTION = 0.02  # of the joints, as a share of what was identified on another arm


class FarSideError(Exception):
    """The host's arm failed, or is not there any more."""


class FarSide:
    """What the host serves, as the guest calls it.

    Attributes:
        memory: shared with the host.
    """

    def __init__(self) -> None:
        shared = _mapped(_SHARED_MEMORY, "resource2", MEMORY_SIZE)
        self.memory = (ctypes.c_char * MEMORY_SIZE).from_buffer(shared)
        self.exchange = Exchange(shared)
        registers = _mapped(PCI_ID, "resource0", REGISTERS_SIZE)
        self._words = memoryview(registers).cast("Q")

    def call(self, call: Call) -> None:
        """Let the host do something; no time passes meanwhile.

        Raises:
            FarSideError: it could not.
        """
        # One read of 8 bytes: the emulated processor waits for its value.
        value = self._words[call // 8]
        if value == DONE:
            return
        if value == 0:
            raise FarSideError(self.exchange.message())
        raise FarSideError("the host's process that simulates the arm has ended.")

    def say(self, call: Call, t_ns: int, text: str) -> None:
        """Call with a text at a time [ns]; raises FarSideError."""
        self.exchange.ask(t_ns, 0, b"")
        self.exchange.say(text)
        self.call(call)


class Line:
    """The far end of the serial adapter: a virtio port, which may have no room."""

    def __init__(self, path: Path) -> None:
        self._port = os.open(path, os.O_RDWR | os.O_NONBLOCK)
        self._left = b""

    def read(self) -> bytes:
        """Return the bytes of the host at the adapter that have arrived."""
        with contextlib.suppress(OSError):
            return os.read(self._port, _AT_ONCE)
        return b""

    def write(self, data: bytes) -> None:
        """Write bytes; what has no room waits for the next call."""
        self._left = (self._left + data)[-MOST_BYTES:]
        if self._left:
            with contextlib.suppress(OSError):
                self._left = self._left[os.write(self._port, self._left) :]


class Relay:
    """Carries frames, bytes and lines; sleeps in between."""

    def __init__(self, options: argparse.Namespace) -> None:
        self._clock = SystemClock()
        self._far = far = FarSide()
        self._can: FrameBatch | None = None
        if options.can:
            self._can = FrameBatch(open_can(options.can), far.memory)
        self._line = Line(options.line) if options.line else None
        self._stdin = sys.stdin.fileno()
        self._lines = Lines(self._stdin)
        self._watched = [self._stdin]
        if self._can is not None:
            self._watched.append(self._can.fileno())
        self._wake_ns = self._clock.now_ns()
        far.say(Call.SERVE, self._wake_ns, json.dumps(_wanted(options)))

    def serve(self) -> None:
        """Go on until a line says quit."""
        clock, watched = self._clock, self._watched
        while True:
            left = (self._wake_ns - clock.now_ns()) / NS_PER_S
            ready = select.select(watched, [], [], max(0.0, left))[0]
            self._advance()
            if self._stdin in ready and not self._obey():
                return

    def _advance(self) -> None:
        """Make one call: what has arrived goes out, what comes back is sent."""
        far, can, line = self._far, self._can, self._line
        count = can.receive() if can is not None else 0
        data = line.read() if line is not None else b""
        far.exchange.ask(self._clock.now_ns(), count, data)
        far.call(Call.ADVANCE)
        self._wake_ns, count, data = far.exchange.answered()
        if count and can is not None:
            can.send(count)
        if line is not None:
            line.write(data)

    def _obey(self) -> bool:
        """Pass lines on; return False where one ends the relay."""
        for line in self._lines.take():
            if line.strip() == "quit":
                return False
            self._far.say(Call.DO, self._clock.now_ns(), line.strip())
        return not self._lines.is_ended


def _wanted(options: argparse.Namespace) -> dict[str, str]:
    """Return what the host is to serve: it does not see the guest's files."""
    config: Path = options.config
    return {
        "rig": config.read_text(encoding="utf-8"),
        "matrix": config.with_name("matrix.toml").read_text(encoding="utf-8"),
        "row": options.row if options.can else "",
        "seed": str(options.seed),
        "friction": str(options.friction),
        "wrong": options.wrong,
        "line": str(options.line or ""),
    }


def _mapped(wanted: tuple[int, int], resource: str, size: int) -> mmap.mmap:
    """Return a resource of the PCI device with a vendor and a device number.

    Raises:
        FarSideError: the machine has no such device.
    """
    for device in _DEVICES.iterdir():
        pair = ((device / name).read_text(encoding="ascii") for name in _PAIR)
        if tuple(int(text, 16) for text in pair) == wanted:
            (device / "enable").write_text("1", encoding="ascii")
            file = os.open(device / resource, os.O_RDWR | os.O_SYNC)
            try:
                return mmap.mmap(file, size)
            finally:
                os.close(file)
    raise FarSideError(f"the machine has no PCI device {wanted}.")


_PAIR = ("vendor", "device")


def main() -> None:
    """Serve until a line says quit."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--config", type=Path, required=True)
    options.add_argument("--can", metavar="CHANNEL", help="an arm, on this interface")
    options.add_argument("--line", type=Path, help="a serial sensor, on this port")
    options.add_argument("--row", default="TF")
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--friction", type=float, default=_FRICTION)
    options.add_argument("--wrong", default="", metavar="NAME", help="of the catalogue")
    relay = Relay(options.parse_args())
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    relay.serve()


if __name__ == "__main__":
    main()
