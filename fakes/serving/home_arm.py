"""An arm at its home position, carried by a person or left to itself, to be served."""

from dataclasses import dataclass, replace

import numpy as np

from acquisition.clock import PERIOD_NS, Clock
from acquisition.devices import SafetyMode
from fakes.plant.model import PlantOptions, Support
from fakes.plant.plant import ArmPlant
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
_AIDED = PlantOptions(support=Support.PERSON)
_UNAIDED = PlantOptions(friction=1.0, has_hand=False)
_NO_BODY = Body(0.0, np.zeros(3), np.zeros((3, 3)))
_PLATE = Tool(_NO_BODY, _NO_BODY, np.zeros(3), sensor_height=0.0)


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
    network = PuckNetwork(plant, found, now_ns, load)
    sensor = None
    if pose.line is not None:
        sensor = SensorServer(pose.line, plant.sensor_load, clock)
    return PuckServer(network, plant, port, clock, sensor)


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
