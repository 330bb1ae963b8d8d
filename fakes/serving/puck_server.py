"""Serves a puck network to other programs, on the wall clock, in one thread."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

import numpy as np

from acquisition import PERIOD_NS, Clock, SafetyMode
from fakes.bus import CanPort, Frame, SocketHub
from fakes.plant import ArmPlant
from fakes.pucks import (
    SENSOR_FORCE_ERRORS,
    SENSOR_TORQUE_ERRORS,
    Load,
    MotorSide,
    NetworkOptions,
    PendantAction,
    PuckNetwork,
    WiredNetwork,
)
from fakes.randomness import trial_generator
from fakes.sensor import SensorErrors
from fakes.serving.sensor_server import SensorLine, SensorServer
from fakes.world_clock import TICK_NS, WorldClock
from ft_sensor import TerrainFrame
from wam.model import Tool, load_constants

_SEED = 1  # of the sensor's errors

Tap = Callable[[int, bytes], None]


class Port(Protocol):
    """Where hosts are: a Readable that frames come from and go to.

    Attributes:
        ignored: what came and was no classic data frame.
        lost: frames that were not taken in time.
    """

    ignored: int
    lost: int

    @property
    def name(self) -> str:
        """The bus as INTERFACE:CHANNEL."""
        ...

    def fileno(self) -> int:
        """Return the descriptor to wait on, -1 if there is none."""
        ...

    def is_readable(self) -> bool:
        """Return whether something has arrived."""
        ...

    def receive(self) -> list[Frame]:
        """Return the frames of hosts that have arrived; never waits."""
        ...

    def send(self, can_id: int, data: bytes) -> None:
        """Send a frame of the network; never waits."""
        ...

    def close(self) -> None:
        """Leave the bus."""
        ...


class SupportedMotors:
    """Motors of an arm that a person carries as long as no motor pulls.

    Implements fakes.pucks.bank.MotorSide. Without power, and under zero torque, the arm
    stays where it is instead of falling.
    """

    def __init__(self, motors: MotorSide) -> None:
        self._motors = motors
        self._is_braked = True

    def advance(self, t_ns: int) -> None:
        """Let the world go on to `t_ns`."""
        self._motors.advance(t_ns)

    def counts(self) -> Sequence[int]:
        """Return the encoder counts of the seven motors now."""
        return self._motors.counts()

    def set_braking(self, is_braked: bool, is_powered: bool) -> None:
        """Brake or release the joints; the torques that follow decide."""
        self._is_braked = is_braked or not is_powered

    def set_torques(self, units: Sequence[int]) -> None:
        """Apply torques [puck units]; under zero torque the arm is carried."""
        is_held = self._is_braked or not any(units)
        self._motors.set_braking(is_braked=is_held, is_powered=True)
        self._motors.set_torques(units)


class PuckServer:
    """A network and the bus it is served on.

    Whatever carries the frames here, the devices' leave one after the other, as on a
    wire of 1 Mbit/s.

    Attributes:
        network: the pucks.
        sensor: a serial wrist sensor that is served beside them; None = none.
    """

    def __init__(
        self,
        network: PuckNetwork,
        motors: MotorSide,
        port: Port,
        clock: Clock,
        sensor: SensorServer | None = None,
    ) -> None:
        self.network = network
        self._wired = WiredNetwork(network, is_far=True)
        self._motors = motors
        self._port = port
        self._clock = WorldClock(clock)
        self.sensor = sensor

    @property
    def name(self) -> str:
        """The bus as INTERFACE:CHANNEL."""
        if self.sensor is None:
            return self._port.name
        return f"{self._port.name}, {self.sensor.name}"

    @property
    def state(self) -> str:
        """The mode of the safety module in words."""
        return self.network.safety_mode.name.lower().replace("_", "-")

    @property
    def losses(self) -> str:
        """What was not carried, in words; empty if all was."""
        port = self._port
        words = [self.sensor.losses] if self.sensor and self.sensor.losses else []
        if port.ignored or port.lost:
            words.append(
                f"{port.ignored} packets were no classic data frames and were ignored; "
                f"{port.lost} frames were lost because nobody took them in time."
            )
        return " ".join(words)

    def press(self, action: PendantAction) -> None:
        """Press a button of the pendant now."""
        self._clock.go_on()
        self.network.pendant(action)

    def step(self, tap: Tap | None = None) -> None:
        """Wait for a frame or for the network, 2 ms at most, and let both go on.

        Args:
            tap: called for every frame on the bus.

        Raises:
            LinkError: the bus broke.
        """
        self._clock.wait(self._port, self._deadline_ns())
        now_ns = self._clock.go_on()
        for can_id, data in self._port.receive():
            if tap is not None:
                tap(can_id, data)
            self._wired.send(now_ns, can_id, data)
        for _, can_id, data in self._wired.advance(now_ns):
            self._port.send(can_id, data)
            if tap is not None:
                tap(can_id, data)
        # Nobody may have looked at the arm for long; catching up would delay answers.
        self._motors.advance(now_ns)
        if self.sensor is not None:
            self.sensor.step()

    def close(self) -> None:
        """Leave the bus, pull the sensor's cable."""
        self._port.close()
        if self.sensor is not None:
            self.sensor.close()

    def _deadline_ns(self) -> int:
        now_ns, event_ns = self._clock.now_ns(), self._wired.next_event_ns()
        left = TICK_NS if event_ns is None else event_ns - now_ns
        return now_ns + max(0, min(left, TICK_NS))


def open_can_port(interface: str, channel: str, bitrate: int) -> Port:
    """Return the place where a network is to be served.

    Raises:
        SettingsError: the socket's path is in use or cannot be one.
        LinkError: the bus cannot be opened.
    """
    if interface == "traction-fake":
        return SocketHub(Path(channel))
    return CanPort(interface, channel, bitrate)


@dataclass(frozen=True, slots=True)
class HomePose:
    """An arm at its home position, and how it is pose.

    Attributes:
        tool: what it carries.
        frame: where the container stands.
        line: of a serial sensor; None = the sensor is on the bus.
        is_idle_first: powered, idle, pucks asleep; otherwise in E-STOP.
    """

    tool: Tool
    frame: TerrainFrame
    line: SensorLine | None
    is_idle_first: bool


def build_home_server(port: Port, pose: HomePose, clock: Clock) -> PuckServer:
    """Return a server of an arm that stands at its home position, not zeroed.

    It has a force/torque sensor on its bus or on a serial line.

    Raises:
        SettingsError: the serial line's path is in use or cannot be one.
    """
    constants = load_constants()
    home = constants.home.copy()
    # Home lies on or past two stops; a simulated spring would throw the arm off them.
    constants = replace(
        constants,
        q_lower=np.minimum(constants.q_lower, home),
        q_upper=np.maximum(constants.q_upper, home),
    )
    plant = ArmPlant(constants, pose.tool, pose.frame, home)
    now_ns = clock.now_ns()
    plant.t_ns = now_ns // PERIOD_NS * PERIOD_NS
    motors = SupportedMotors(plant)
    rng = trial_generator(_SEED, "home", 0)
    errors = SensorErrors(rng, SENSOR_FORCE_ERRORS, SENSOR_TORQUE_ERRORS)
    options = NetworkOptions(
        safety_mode=SafetyMode.IDLE if pose.is_idle_first else SafetyMode.E_STOP,
        are_asleep=True,
        has_sensor=pose.line is None,
        is_zeroed=False,
        mt=constants.mt,
    )
    load = Load(plant.sensor_load, errors)
    network = PuckNetwork(motors, options, now_ns, load)
    sensor = None
    if pose.line is not None:
        sensor = SensorServer(pose.line, plant.sensor_load, clock)
    return PuckServer(network, motors, port, clock, sensor)
