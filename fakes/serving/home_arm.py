"""A served arm at its home position, carried by a person or unsupported."""

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
from fakes.world.deviation import RigDeviation
from fakes.world.true_rig import (
    apply_deviation,
    sensor_reading,
    true_constants,
    true_network,
    true_options,
    true_tool,
)
from ft_sensor.payload import TerrainFrame
from wam.bus.frames import MOTOR_NODES
from wam.model.constants import ArmConstants, Array, Body, load_constants
from wam.model.tool import Tool

_JOINT_6 = 5
_SEED = 1  # of the sensor's errors
_AIDED = PlantOptions(support=Support.PERSON)
_UNAIDED = PlantOptions(friction=1.0, has_hand=False)
_NO_BODY = Body(0.0, np.zeros(3), np.zeros((3, 3)))
_PLATE = Tool(_NO_BODY, _NO_BODY, np.zeros(3), sensor_height=0.0)


@dataclass(frozen=True, slots=True)
class HomePose:
    """Initial state of an arm at its home position.

    Attributes:
        tool: sensor and foot on its plate; None = the bare plate without a sensor.
        frame: location of the container.
        line: line of a serial sensor; None = the sensor is on the bus.
        is_idle_first: powered, idle, pucks asleep; otherwise in E-STOP.
        has_hand: a person carries the arm, with almost no friction; otherwise it has
            the full friction identified on another arm.
        firmware: versions of the motor pucks and of the safety module.
        is_at_rest: joint 6 is on its upper stop, held there by gravity.
        friction: scale of the joint friction; None = by `has_hand`.
        seed: seed of friction and windings; None = nominal values.
        deviation: deviation of the hardware from the settings; None = none.
    """

    tool: Tool | None
    frame: TerrainFrame
    line: SensorLine | None
    is_idle_first: bool
    has_hand: bool = True
    firmware: tuple[int, int] = (200, 200)
    is_at_rest: bool = False
    friction: float | None = None
    seed: int | None = None
    deviation: RigDeviation | None = None


def build_home_server(port: Port, pose: HomePose, clock: Clock) -> PuckServer:
    """Return a server of an arm at its home position, not zeroed.

    With a tool it has a force/torque sensor on its bus or on a serial line.

    Raises:
        SettingsError: the serial line's path is in use or cannot be one.
    """
    deviation = pose.deviation or RigDeviation()
    believed, now_ns = load_constants(), clock.now_ns()
    constants = true_constants(believed, deviation)
    options = replace(_AIDED if pose.has_hand else _UNAIDED, seed=pose.seed)
    if pose.friction is not None:
        options = replace(options, friction=pose.friction)
    options = true_options(options, deviation)
    tool = true_tool(pose.tool or _PLATE, deviation)
    q = _zeroing_pose(constants, deviation, is_at_rest=pose.is_at_rest)
    plant = ArmPlant(constants, tool, pose.frame, q, options)
    plant.t_ns = now_ns // PERIOD_NS * PERIOD_NS
    rng = trial_generator(_SEED, "home", 0)
    errors = SensorErrors(rng, SENSOR_FORCE_ERRORS, SENSOR_TORQUE_ERRORS)
    network_options = NetworkOptions(
        safety_mode=SafetyMode.IDLE if pose.is_idle_first else SafetyMode.E_STOP,
        are_asleep=True,
        has_sensor=pose.line is None and pose.tool is not None,
        is_zeroed=False,
        vers=(pose.firmware[0],) * len(MOTOR_NODES),
        safety_vers=pose.firmware[1],
        mt=constants.mt,
    )
    source = sensor_reading(plant.sensor_load, deviation)
    network = PuckNetwork(
        plant, true_network(network_options, deviation), now_ns, Load(source, errors)
    )
    # The zero errors are part of the pose at zeroing, so not of the wiring.
    apply_deviation(plant, network, replace(deviation, zeros=np.zeros(7)), believed)
    sensor = None
    if pose.line is not None:
        sensor = SensorServer(pose.line, source, clock)
    return PuckServer(network, plant, port, clock, sensor, plant)


def _zeroing_pose(
    constants: ArmConstants, deviation: RigDeviation, *, is_at_rest: bool
) -> Array:
    """Return the pose in which a person zeroes the arm [rad], shape (7,).

    The home position less the errors of the zeros, within the stops.
    """
    q = constants.home - deviation.zeros
    if is_at_rest:
        q[_JOINT_6] = constants.q_upper[_JOINT_6]
    return np.clip(q, constants.q_lower, constants.q_upper)
