"""Build the parts of a rig from settings: tool, limits, arm, sensor, cycle."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acquisition.clock import Clock
from acquisition.control_loop.cycle import Cycle, CycleOutputs
from acquisition.control_loop.limits import GuardLimits
from acquisition.devices import WrenchSample, WrenchSensor
from acquisition.errors import SettingsError
from acquisition.ipc.frame_ring import FrameRing
from acquisition.ipc.layout import SharedLayout
from acquisition.ipc.loop_server import LoopHooks, LoopServer, no_sound
from acquisition.ipc.shared_sensor import SharedSensor, publish
from acquisition.sample import Flag
from acquisition.settings import read_text
from experiments.settings.load import Settings
from experiments.settings.matrix import TerrainRow
from experiments.settings.rig import FootSection, RigSettings
from experiments.settings.sensor import build_device
from ft_sensor.payload import LiveFoot, TerrainFrame, payload_of
from ft_sensor.serial_line.link import SerialLink, SerialPort
from ft_sensor.serial_line.sensor import SerialSensor
from ft_sensor.vendors.barrett import BarrettSensor
from wam.bus.link import CanLink, Transport
from wam.control.controller import FootController
from wam.control.friction_compensation import FrictionCompensation
from wam.control.joint_lock import LockGains
from wam.control.soft_walls import SoftWalls, Walls
from wam.driver.arm import WamArm
from wam.driver.health import health_metadata
from wam.driver.lost_positions import LostPositions
from wam.driver.puck_properties import known_table
from wam.driver.safety_module import WARNING_SHARE, SafetyLimits
from wam.driver.settings import ArmSettings
from wam.model.arm_model import ArmModel
from wam.model.constants import ArmConstants, Array, Body
from wam.model.start_pose import elbow_up, lowered_to
from wam.model.tool import Tool, sensor_body

LOST_POSITIONS = "positions-lost.txt"  # in the folder of rig.toml


def terrain_frame(row: TerrainRow) -> TerrainFrame:
    """Return the terrain frame of a row of the matrix.

    That of its container; for a push away from the base the same seen from its other
    end: trials start at the near end, and downhill becomes uphill.
    """
    frame = TerrainFrame(
        incline=float(np.radians(row.incline_deg)),
        heading=float(np.radians(row.heading_deg)),
        start=row.far_end,
        travel=row.travel,
    )
    return frame if row.push_deg == 0 else frame.from_other_end()


def start_of(row: TerrainRow, model: ArmModel) -> Array:
    """Joint positions with the foot at the start of a trial [rad], stated or computed.

    Args:
        row: row of the matrix.
        model: the arm with its tool.

    Raises:
        SettingsError: the start is out of reach.
    """
    frame = terrain_frame(row)
    start, axes = np.array(frame.start), frame.axes()
    if row.start_q is None:
        try:
            return elbow_up(model, axes, start)
        except SettingsError as error:
            raise SettingsError(
                f"{row.name}: {error.message}", hint=error.hint
            ) from error
    stated = np.array(row.start_q)
    if row.push_deg == 0:
        return stated
    return lowered_to(model, axes, start, stated, 0.0)


def build_tool(rig: RigSettings, foot: str) -> Tool:
    """Return sensor and foot as rig.toml describes them."""
    return tool_with(rig, rig.feet[foot])


def tool_with(rig: RigSettings, section: FootSection) -> Tool:
    """Return the sensor of rig.toml with the foot that `section` describes."""
    sensor = rig.ft_sensor
    body = sensor_body()
    return Tool(
        sensor=Body(sensor.mass, body.com, body.inertia),
        foot=Body(
            section.mass, np.array(section.com), np.diag(np.array(section.inertia))
        ),
        sole=np.array(section.sole),
        sensor_height=sensor.height,
        sensor_angle=float(np.radians(sensor.angle_deg)),
        sensor_sign=float(sensor.sign),
    )


def build_limits(rig: RigSettings, constants: ArmConstants) -> GuardLimits:
    """Return the guard's limits of rig.toml."""
    return GuardLimits(
        q_lower=tuple(constants.q_lower.tolist()),
        q_upper=tuple(constants.q_upper.tolist()),
        **rig.guard_limits(),
    )


def build_walls(rig: RigSettings, constants: ArmConstants) -> Walls:
    """Return the soft walls before the joint stops."""
    return Walls(
        lower=tuple(constants.q_lower.tolist()),
        upper=tuple(constants.q_upper.tolist()),
        torque=rig.limits.torque,
        damping=tuple(constants.kd.tolist()),
    )


def build_safety_limits(rig: RigSettings) -> SafetyLimits:
    """Return the limits for the safety module; see [safety] of rig.toml."""
    safety = rig.safety
    speed, torque = safety.speed_warning, safety.torque_warning_units
    if speed is None:
        speed = WARNING_SHARE * safety.speed_fault
    if torque is None:
        torque = int(WARNING_SHARE * safety.torque_fault_units)
    return SafetyLimits(speed, safety.speed_fault, torque, safety.torque_fault_units)


def build_link(transport: Transport, shared: SharedLayout, clock: Clock) -> CanLink:
    """Return the link over a transport; frames are copied to the shared memory."""
    return CanLink(transport, FrameRing(shared.frames, clock).add)


def read_properties(settings: Settings) -> str:
    """Return the property table of this arm's pucks as text, "" for the factory's.

    Raises:
        SettingsError: the file named in rig.toml cannot be read or is no such table.
    """
    name = settings.rig.arm.properties
    if name is None:
        return ""
    path = settings.folder / name
    try:
        text = read_text(path)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise SettingsError(
            f"The puck properties {path} cannot be read ({reason}).",
            hint="Bring the file back, or take the line properties out of [arm] of "
            "rig.toml. Nothing was started.",
        ) from error
    known_table(text, name)
    return text


def build_arm(
    rig: RigSettings,
    constants: ArmConstants,
    link: CanLink,
    clock: Clock,
    properties: str = "",
    lost: Path | None = None,
) -> WamArm:
    """Return the driver of the arm on `link`.

    Args:
        rig: settings of the rig.
        constants: constants of the arm.
        link: its bus.
        clock: clock of the loop.
        properties: property table of its pucks, "" for the factory's.
        lost: file that records lost positions; None = not recorded.
    """
    settings = ArmSettings(
        j2mp=constants.j2mp,
        safety_limits=build_safety_limits(rig),
        speed_limits=tuple(rig.limits.speed),
        pucks=known_table(properties, rig.arm.properties or "pucks.toml"),
    )
    return WamArm(link, clock, settings, LostPositions(lost))


def open_bus_sensor(arm: WamArm, link: CanLink, clock: Clock) -> BarrettSensor:
    """Open the wrist sensor on the arm's bus; the arm polls it from then on.

    Raises:
        LinkError: the sensor is silent.
        DeviceFaultError: the sensor reports a fault.
    """
    sensor = BarrettSensor(link, clock)
    sensor.open()
    arm.attach_device(sensor)
    return sensor


def build_sensor(
    rig: RigSettings, port: SerialPort, clock: Clock, *, is_simulated: bool
) -> SerialSensor:
    """Return the wrist sensor on `port`, not opened yet.

    Raises:
        SettingsError: the sensor is not a serial one.
    """
    device = build_device(rig.ft_sensor, is_simulated=is_simulated)
    if device is None:
        raise SettingsError(
            "The F/T sensor has no serial line.", hint="Check ft_sensor.kind."
        )
    return SerialSensor(SerialLink(port), clock, device)


@dataclass(frozen=True, slots=True)
class LawParts:
    """Models of the control law, calibrated as far as available.

    Attributes:
        model: the arm with its tool, for everything but gravity.
        gravity_model: gravity model of the control law.
        compensation: friction compensation; None = none.
    """

    model: ArmModel
    gravity_model: ArmModel
    compensation: FrictionCompensation | None


@dataclass(frozen=True, slots=True)
class LoopConfig:
    """Configuration of a loop.

    Attributes:
        rig: rig.toml.
        row: row of the matrix.
        law: models and compensation.
        arm: driver of the arm.
        sensor: the wrist sensor as the loop polls it.
        shared: the memory that the processes share.
        clock: the loop's clock.
        is_simulated: whether the devices are simulated.
        sound: rings the bell of the console.
    """

    rig: RigSettings
    row: TerrainRow
    law: LawParts
    arm: WamArm
    sensor: WrenchSensor
    shared: SharedLayout
    clock: Clock
    is_simulated: bool
    sound: Callable[[], None] = no_sound


def build_loop_server(parts: LoopConfig) -> LoopServer:
    """Join arm, sensor, law and guard into a runnable cycle."""
    control, shared = parts.rig.control, parts.shared
    model = parts.law.model
    assert model.tool is not None
    is_shared = isinstance(parts.sensor, SharedSensor)

    def on_wrench(samples: list[WrenchSample]) -> None:
        if not is_shared:  # a shared sensor publishes by itself
            publish(samples, shared.wrenches)

    def metadata() -> dict[str, str]:
        arm, compensation = parts.arm, parts.law.compensation
        friction = {} if compensation is None else compensation.metadata()
        return {
            **friction,
            **health_metadata(arm.health(), parts.clock.now_ns()),
            **arm.counters.metadata(),
            "link": arm.counters.text(),
        }

    frame = terrain_frame(parts.row)
    law = FootController(
        parts.law.gravity_model,
        control.virtual_mass,
        LockGains(kp=control.lock_kp, kd=control.lock_kd),
        SoftWalls(build_walls(parts.rig, model.constants)),
        parts.law.compensation,
    )
    cycle = Cycle(
        parts.arm,
        parts.sensor,
        law,
        LiveFoot(model, payload_of(model.tool), frame),
        build_limits(parts.rig, model.constants),
        CycleOutputs(
            shared.cycles.write,
            on_wrench,
            extra_flags=Flag.SIMULATED if parts.is_simulated else 0,
        ),
    )
    hooks = LoopHooks(parts.clock.now_ns, metadata, parts.sound)
    return LoopServer(cycle, parts.arm, shared, hooks)
