"""A serial sensor at the far end of the adapter, with or without an arm."""

from typing import Protocol

import numpy as np

from acquisition.clock import Clock
from experiments.rig.build import build_tool
from experiments.rig.fake import sensor_metadata
from experiments.settings.load import Settings
from fakes.sensor.errors import SensorErrors
from fakes.sensor.kinds import SensorChoice, make_stream
from fakes.sensor.stream import SensorStream
from fakes.serving.sensor_server import hanging_load
from fakes.world_clock import TICK_NS, WorldClock
from lab.calls import Frame

Turn = tuple[int, list[Frame], bytes]  # time until the next call [ns], frames, bytes


class Served(Protocol):
    """A simulated device that the relay serves."""

    def advance(self, frames: list[Frame], data: bytes) -> Turn:
        """Simulate up to now.

        Args:
            frames: frames from the program on the bus.
            data: bytes from the program on the serial line.

        Returns:
            Time until the next event [ns], frames and bytes to send now.
        """
        ...

    def do(self, line: str) -> None:
        """Carry out an operator's command; raises KeyError if it is unknown."""
        ...


class FarEnd:
    """A sensor at the end of a serial line."""

    def __init__(self, stream: SensorStream, t_ns: int) -> None:
        self._stream = stream
        stream.due(t_ns)
        stream.port_opened(t_ns)

    def advance(self, t_ns: int, data: bytes) -> bytes:
        """Receive the program's bytes; return the sensor's bytes up to `t_ns`."""
        if data:
            self._stream.receive(t_ns, data)
        return b"".join(part for _, part in self._stream.due(t_ns))


class LineSensor:
    """Implements Served: a sensor with a foot below it and no arm."""

    def __init__(self, settings: Settings, clock: Clock) -> None:
        self._clock = WorldClock(clock)
        rig, t_ns = settings.rig, self._clock.now_ns()
        tool = build_tool(rig, settings.matrix.terrains[0].foot)
        choice = SensorChoice(**sensor_metadata(rig.ft_sensor))
        errors = SensorErrors(np.random.default_rng(1))
        stream = make_stream(choice, hanging_load(tool), errors, t_ns)
        self._end = FarEnd(stream, t_ns)

    def advance(self, frames: list[Frame], data: bytes) -> Turn:
        """Simulate the sensor up to now."""
        del frames
        return TICK_NS, [], self._end.advance(self._clock.advance_to_now(), data)

    def do(self, line: str) -> None:
        """Raise KeyError: there are no commands."""
        raise KeyError(line)
