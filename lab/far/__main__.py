"""Serve arms and sensors to one machine: python -m lab.far --link FD --memory FILE."""

import argparse
import json
import mmap
import socket
import sys
import tempfile
import traceback
from collections.abc import Sequence
from pathlib import Path

from acquisition.clock import Readable
from experiments.settings.load import Settings, load_settings
from lab.calls import DONE, MEMORY_SIZE, Call, Exchange
from lab.far.line_sensor import LineSensor, Served
from lab.far.proxy_device import ProxyDevice
from lab.far.pushed_arm import PushedArm

_FAILED = 0


class GuestClock:
    """Implements acquisition.clock.Clock with the guest's time of the last call.

    Attributes:
        t_ns: time of the last call [ns].
    """

    def __init__(self) -> None:
        self.t_ns = 0

    def now_ns(self) -> int:
        """Return the guest's monotonic time [ns]."""
        return self.t_ns

    def utc_ns(self) -> int:
        """Return the monotonic time, since no date is known here."""
        return self.t_ns

    def sleep_until(self, t_ns: int) -> None:
        """Raise: nothing here waits."""
        raise NotImplementedError

    def wait(self, link: Readable, deadline_ns: int) -> bool:
        """Raise: nothing here waits."""
        raise NotImplementedError


class FarSide:
    """Executes the guest's calls."""

    def __init__(self, exchange: Exchange) -> None:
        self._exchange = exchange
        self._clock = GuestClock()
        self._served: Served | None = None

    def call(self, offset: int) -> int:
        """Execute a call; return DONE, or another value and the error as text."""
        try:
            self._do(Call(offset))
        except Exception:  # reported to the guest, where the scenario fails
            self._exchange.say(traceback.format_exc())
            return _FAILED
        return DONE

    def _do(self, call: Call) -> None:
        t_ns, frames, data = self._exchange.asked()
        self._clock.t_ns = t_ns
        if call is Call.SERVE:
            self._served = self._build(json.loads(self._exchange.message()))
        elif self._served is None:
            raise ValueError("nothing is served yet.")
        elif call is Call.DO:
            self._served.do(self._exchange.message())
        else:
            wait_ns, sent, written = self._served.advance(frames, data)
            self._exchange.answer(t_ns + wait_ns, sent, written)

    def _build(self, request: dict[str, str]) -> Served:
        settings = _settings(request["rig"], request["matrix"])
        if not request["row"]:
            return LineSensor(settings, self._clock)
        return PushedArm(
            settings,
            request["row"],
            int(request["seed"]),
            self._clock,
            has_line=request["line"] != "",
            friction=float(request["friction"]),
            wrong=request["wrong"],
        )


def _settings(rig: str, matrix: str) -> Settings:
    """Return the settings from the texts of rig.toml and matrix.toml."""
    with tempfile.TemporaryDirectory(prefix="lab") as scratch:
        folder = Path(scratch)
        (folder / "rig.toml").write_text(rig, encoding="utf-8")
        (folder / "matrix.toml").write_text(matrix, encoding="utf-8")
        return load_settings(folder / "rig.toml")


def main(arguments: Sequence[str] | None = None) -> None:
    """Serve until the emulator ends."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--link", type=int, required=True, metavar="FD")
    options.add_argument("--memory", type=Path, required=True, metavar="FILE")
    args = options.parse_args(arguments)
    with args.memory.open("r+b") as file:
        memory = mmap.mmap(file.fileno(), MEMORY_SIZE)
    with socket.socket(fileno=args.link) as link:
        ProxyDevice(link, FarSide(Exchange(memory)).call).serve()


if __name__ == "__main__":
    sys.exit(main())
