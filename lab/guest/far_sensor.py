"""A serial sensor behind the adapter: python -m lab.guest.far_sensor --config FILE.

A foot hangs below it, without an arm. Lines on stdin: off, on, quit.
"""

import argparse
import contextlib
import os
import sys
from pathlib import Path

import numpy as np

from acquisition import SystemClock
from experiments.rig import build_tool
from experiments.rig.fake import sensor_metadata
from experiments.settings import load_settings
from experiments.tools import Lines
from fakes.sensor import SensorChoice, SensorErrors, SensorStream, make_stream
from fakes.serving import hanging_load
from fakes.world_clock import TICK_NS, WorldClock

_AT_ONCE = 4096


class FarEnd:
    """The sensor's end of the serial adapter: bytes to and from a virtio port."""

    def __init__(self, stream: SensorStream, path: Path, t_ns: int) -> None:
        self._stream = stream
        self._port = os.open(path, os.O_RDWR | os.O_NONBLOCK)
        self._is_on = True
        self._left = b""
        stream.due(t_ns)
        stream.port_opened(t_ns)

    def switch(self, t_ns: int, *, is_on: bool) -> None:
        """Take the sensor's power away, or give it back: it starts anew."""
        self._is_on = is_on
        self._left = b""
        self._stream.due(t_ns)
        if is_on:
            self._stream.reset(t_ns)

    def advance(self, t_ns: int) -> None:
        """Carry bytes both ways up to `t_ns`."""
        with contextlib.suppress(OSError):
            data = os.read(self._port, _AT_ONCE)
            if data and self._is_on:
                self._stream.receive(t_ns, data)
        if not self._is_on:
            return
        self._left += b"".join(data for _, data in self._stream.due(t_ns))
        if not self._left:
            return
        with contextlib.suppress(OSError):
            self._left = self._left[os.write(self._port, self._left) :]


def main() -> None:
    """Serve until a line says quit."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--config", type=Path, required=True)
    options.add_argument("--line", type=Path, required=True)
    given = options.parse_args()
    settings = load_settings(given.config)
    rig = settings.rig
    tool = build_tool(rig, settings.matrix.terrains[0].foot)
    choice = SensorChoice(**sensor_metadata(rig.ft_sensor))
    clock = WorldClock(SystemClock())
    errors = SensorErrors(np.random.default_rng(1))
    stream = make_stream(choice, hanging_load(tool), errors, clock.now_ns())
    end = FarEnd(stream, given.line, clock.now_ns())
    lines = Lines(sys.stdin.fileno())
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    while True:
        clock.sleep_until(clock.now_ns() + TICK_NS)
        now_ns = clock.go_on()
        end.advance(now_ns)
        for line in lines.take():
            if line.strip() == "quit":
                return
            end.switch(now_ns, is_on=line.strip() == "on")


if __name__ == "__main__":
    main()
