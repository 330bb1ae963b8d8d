"""An arm at its home position, carried by a person or left to itself, to be served."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from acquisition.clock import PERIOD_NS, Clock
from acquisition.devices import SafetyMode
from fakes.plant.model import PlantOptions
from fakes.plant.plant import ArmPlant
from fakes.pucks.bank import MotorSide
from fakes.pucks.ft_puck import SENSOR_FORCE_ERRORS, SENSOR_TORQUE_ERRORS, Load
from fakes.pucks.network import PuckNetwork
from fakes.pucks.options import NetworkOptions
from fakes.randomness import trial_generator
from fakes.sensor.errors import SensorErrors
from fakes.serving.puck_server import Port, PuckServer
from fakes.serving.sensor_server import SensorLine, SensorServer
from ft_sensor.payload import TerrainFrame
from wam.bus.frames import MOTOR_NODES
from wam.model.constants import ArmConstants, Body, load_constants
from wam.model.tool import Tool

_SEED = 1  # of the sensor's errors
_AIDED = PlantOptions()
_UNAIDED = PlantOptions(friction=1.0, has_hand=False)
_NO_BODY = Body(0.0, np.zeros(3), np.zeros((3, 3)))
_PLATE = Tool(_NO_BODY, _NO_BODY, np.zeros(3), sensor_height=0.0)


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


class StandingMotors:
    """Motors of an arm that nobody carries.

    Implements fakes.pucks.bank.MotorSide. The arm stands where it was put until it is
    activated for the first time; from then on it falls when no torque holds it.
    """

    def __init__(self, motors: MotorSide) -> None:
        self._motors = motors
        self._has_been_active = False

    def advance(self, t_ns: int) -> None:
        """Let the world go on to `t_ns`."""
        self._motors.advance(t_ns)

    def counts(self) -> Sequence[int]:
        """Return the encoder counts of the seven motors now."""
        return self._motors.counts()

    def set_braking(self, is_braked: bool, is_powered: bool) -> None:
        """Brake or release the joints."""
        self._has_been_active |= is_powered and not is_braked
        if self._has_been_active:
            self._motors.set_braking(is_braked, is_powered)
        else:
            self._motors.set_braking(is_braked=True, is_powered=True)

    def set_torques(self, units: Sequence[int]) -> None:
        """Apply torques [puck units]."""
        self._motors.set_torques(units)


@dataclass(frozen=True, slots=True)
class HomePose:
    """An arm at its home position, and how it is found.

    Attributes:
        tool: sensor and foot on its plate; None = the bare plate, no sensor at all.
        frame: where the container stands.
        line: of a serial sensor; None = the sensor is on the bus.
        is_idle_first: powered, idle, pucks asleep; otherwise in E-STOP.
        has_hand: a person carries the arm, with hardly any friction then; otherwise it
            has all the friction that was identified on another one.
        firmware: of the motor pucks, and of the safety module.
    """

    tool: Tool | None
    frame: TerrainFrame
    line: SensorLine | None
    is_idle_first: bool
    has_hand: bool = True
    firmware: tuple[int, int] = (200, 200)


def build_home_server(port: Port, pose: HomePose, clock: Clock) -> PuckServer:
    """Return a server of an arm that stands at its home position, not zeroed.

    With a tool it has a force/torque sensor on its bus or on a serial line.

    Raises:
        SettingsError: the serial line's path is in use or cannot be one.
    """
    constants, now_ns = _constants_around_home(), clock.now_ns()
    options = _AIDED if pose.has_hand else _UNAIDED
    tool = pose.tool or _PLATE
    plant = ArmPlant(constants, tool, pose.frame, constants.home, options)
    plant.t_ns = now_ns // PERIOD_NS * PERIOD_NS
    motors = SupportedMotors(plant) if pose.has_hand else StandingMotors(plant)
    rng = trial_generator(_SEED, "home", 0)
    errors = SensorErrors(rng, SENSOR_FORCE_ERRORS, SENSOR_TORQUE_ERRORS)
    found = NetworkOptions(
        safety_mode=SafetyMode.IDLE if pose.is_idle_first else SafetyMode.E_STOP,
        are_asleep=True,
        has_sensor=pose.line is None and pose.tool is not None,
        is_zeroed=False,
        vers=(pose.firmware[0],) * len(MOTOR_NODES),
        safety_vers=pose.firmware[1],
        mt=constants.mt,
    )
    load = Load(plant.sensor_load, errors)
    network = PuckNetwork(motors, found, now_ns, load)
    sensor = None
    if pose.line is not None:
        sensor = SensorServer(pose.line, plant.sensor_load, clock)
    return PuckServer(network, motors, port, clock, sensor)


def _constants_around_home() -> ArmConstants:
    """Return the arm with its stops no further in than home, which lies beyond two.

    A simulated spring would throw the arm off them.
    """
    constants = load_constants()
    return replace(
        constants,
        q_lower=np.minimum(constants.q_lower, constants.home),
        q_upper=np.maximum(constants.q_upper, constants.home),
    )
