"""Connects the far ends of bus and serial line to the host's arm: relay --config FILE.

Lines on stdin are commands to the served device (lab.far.pushed_arm,
lab.far.line_sensor), executed at the guest time of arrival; "quit" ends the relay.
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
    MAX_BYTES,
    MEMORY_SIZE,
    PCI_ID,
    REGISTERS_SIZE,
    Call,
    Exchange,
)
from lab.guest.frame_batch import FrameBatch, open_can

_DEVICES = Path("/sys/bus/pci/devices")
_SHARED_MEMORY = (0x1AF4, 0x1110)  # vendor and device of ivshmem
_READ_SIZE = 4096  # bytes
_FRICTION = 0.02  # joint friction relative to that identified on another arm


class FarSideError(Exception):
    """The host's simulated arm failed or has ended."""


class FarSide:
    """The guest's connection to the device simulated by the host.

    Attributes:
        memory: memory shared with the host.
    """

    def __init__(self) -> None:
        shared = _mapped(_SHARED_MEMORY, "resource2", MEMORY_SIZE)
        self.memory = (ctypes.c_char * MEMORY_SIZE).from_buffer(shared)
        self.exchange = Exchange(shared)
        registers = _mapped(PCI_ID, "resource0", REGISTERS_SIZE)
        self._words = memoryview(registers).cast("Q")

    def call(self, call: Call) -> None:
        """Make a call to the host; no guest time passes meanwhile.

        Raises:
            FarSideError: the call failed.
        """
        # One read of 8 bytes, during which the emulated processor stalls.
        value = self._words[call // 8]
        if value == DONE:
            return
        if value == 0:
            raise FarSideError(self.exchange.message())
        raise FarSideError("the host's process that simulates the arm has ended.")

    def say(self, call: Call, t_ns: int, text: str) -> None:
        """Make a call with a text at time `t_ns`; raises FarSideError."""
        self.exchange.ask(t_ns, 0, b"")
        self.exchange.say(text)
        self.call(call)


class Line:
    """The far end of the serial adapter: a virtio port of limited capacity."""

    def __init__(self, path: Path) -> None:
        self._port = os.open(path, os.O_RDWR | os.O_NONBLOCK)
        self._unsent = b""

    def read(self) -> bytes:
        """Return the bytes received from the program."""
        with contextlib.suppress(OSError):
            return os.read(self._port, _READ_SIZE)
        return b""

    def write(self, data: bytes) -> None:
        """Write bytes; those not accepted by the port wait for the next call."""
        self._unsent = (self._unsent + data)[-MAX_BYTES:]
        if self._unsent:
            with contextlib.suppress(OSError):
                self._unsent = self._unsent[os.write(self._port, self._unsent) :]


class Relay:
    """Forwards frames, bytes and commands; sleeps in between."""

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
        far.say(Call.SERVE, self._wake_ns, json.dumps(_request(options)))

    def serve(self) -> None:
        """Run until the command "quit"."""
        clock, watched = self._clock, self._watched
        while True:
            left = (self._wake_ns - clock.now_ns()) / NS_PER_S
            ready = select.select(watched, [], [], max(0.0, left))[0]
            self._advance()
            if self._stdin in ready and not self._forward_commands():
                return

    def _advance(self) -> None:
        """Make one call: forward received frames and bytes, send those returned."""
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

    def _forward_commands(self) -> bool:
        """Forward the commands on stdin; return False if the relay must end."""
        for line in self._lines.take():
            if line.strip() == "quit":
                return False
            self._far.say(Call.DO, self._clock.now_ns(), line.strip())
        return not self._lines.is_ended


def _request(options: argparse.Namespace) -> dict[str, str]:
    """Return the device to serve, file contents included: the host cannot read them."""
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


def _mapped(pci_id: tuple[int, int], resource: str, size: int) -> mmap.mmap:
    """Return the mapped resource of the PCI device with a (vendor, device) number.

    Raises:
        FarSideError: the machine has no such device.
    """
    for device in _DEVICES.iterdir():
        pair = ((device / name).read_text(encoding="ascii") for name in _PAIR)
        if tuple(int(text, 16) for text in pair) == pci_id:
            (device / "enable").write_text("1", encoding="ascii")
            file = os.open(device / resource, os.O_RDWR | os.O_SYNC)
            try:
                return mmap.mmap(file, size)
            finally:
                os.close(file)
    raise FarSideError(f"the machine has no PCI device {pci_id}.")


_PAIR = ("vendor", "device")


def main() -> None:
    """Serve until the command "quit"."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--config", type=Path, required=True)
    options.add_argument("--can", metavar="CHANNEL", help="serve an arm on it")
    options.add_argument("--line", type=Path, help="serve a serial sensor on this port")
    options.add_argument("--row", default="TF")
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--friction", type=float, default=_FRICTION)
    options.add_argument("--wrong", default="", metavar="NAME", help="error of the arm")
    relay = Relay(options.parse_args())
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    relay.serve()


if __name__ == "__main__":
    main()
