"""Server of a simulated wrist sensor for other programs, on the wall clock."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acquisition.clock import Clock
from acquisition.errors import SettingsError
from fakes.randomness import trial_generator
from fakes.sensor.errors import SensorErrors
from fakes.sensor.kinds import SensorChoice, make_stream, plug
from fakes.sensor.stream import Source
from fakes.world_clock import TICK_NS, WorldClock
from wam.model.constants import GRAVITY
from wam.model.tool import Tool

_SEED = 2  # of the sensor's errors


@dataclass(frozen=True, slots=True)
class SensorLine:
    """A sensor and the path on which it is served."""

    path: Path
    choice: SensorChoice


class SensorServer:
    """A sensor on a path that other programs open as a serial port."""

    def __init__(self, line: SensorLine, source: Source, clock: Clock) -> None:
        """Plug the sensor in; `source` is its load.

        Raises:
            SettingsError: the path is in use or cannot be one.
        """
        self._clock = WorldClock(clock)
        self._kind = line.choice.kind
        now_ns = self._clock.now_ns()
        errors = SensorErrors(trial_generator(_SEED, "home", 0))
        stream = make_stream(line.choice, source, errors, now_ns)
        try:
            self._pty = plug(line.choice, stream, now_ns, line.path)
        except OSError as error:
            raise SettingsError(
                f"--serial {line.path} cannot be served ({error.strerror}).",
                hint="Name a path that does not exist yet. Nothing was started.",
            ) from error

    @property
    def name(self) -> str:
        """The sensor and its path."""
        return f"{self._kind} sensor on {self._pty.path}"

    @property
    def losses(self) -> str:
        """Report of bytes not read in time; empty if there are none."""
        lost = self._pty.overrun
        return f"{lost} bytes of the sensor were not read in time." if lost else ""

    def fileno(self) -> int:
        """Return the descriptor that is readable when a host has sent bytes."""
        return self._pty.fileno()

    def is_readable(self) -> bool:
        """Return False: input of hosts is polled in every step."""
        return False

    def wait(self) -> None:
        """Wait at most 2 ms for input of a host."""
        self._clock.wait(self, self._clock.now_ns() + TICK_NS)

    def step(self) -> None:
        """Transfer bytes both ways up to now."""
        self._pty.advance(self._clock.advance_to_now())

    def close(self) -> None:
        """Unplug the cable; the path is removed."""
        self._pty.unplug()


def hanging_load(tool: Tool) -> Source:
    """Return the constant load [N, N m] of a foot hanging below a sensor at rest."""
    foot = tool.foot
    arm = np.array(foot.com) - np.array([0.0, 0.0, tool.sensor_height])
    force = np.array([0.0, 0.0, tool.sensor_sign * foot.mass * GRAVITY])
    wrench = tuple(map(float, np.concatenate([force, np.cross(arm, force)])))
    return lambda _: wrench
