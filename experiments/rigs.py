"""The composition root: settings and a row of the matrix in, a rig out."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from acquisition.clock import Clock, SystemClock
from acquisition.control import InlineControl
from acquisition.cycle import Cycle
from acquisition.devices import WrenchSample, WrenchSensor
from acquisition.flight import FrameTape
from acquisition.guard import Limits
from acquisition.loop import Loop
from acquisition.recorder import Recorder
from acquisition.sample import Flag
from acquisition.shared import SampleRing
from experiments.rehearsing import Rehearsing
from experiments.settings import FootSection, RigSettings, Settings, TerrainRow
from ft_sensor.barrett import BarrettSensor
from ft_sensor.observer import LiveFoot
from ft_sensor.payload import Payload, TerrainFrame, payload_of
from ft_sensor.sensor import BotaSensor
from ft_sensor.sensor_settings import SensorSettings
from ft_sensor.serial_link import SerialLink, SerialPort, open_port
from wam.arm import WamArm
from wam.arm_settings import ArmSettings
from wam.can_link import CanLink, open_bus
from wam.constants import ArmConstants, Body, load_constants
from wam.controller import FootController
from wam.joint_lock import LockGains
from wam.model import ArmModel
from wam.safety_limits import WARNING_SHARE, SafetyLimits
from wam.tapped_link import TappedLink
from wam.tool import Tool, sensor_body

if TYPE_CHECKING:
    from fakes.rig import FakeRig
    from fakes.serve import PuckServer

MS = 1_000_000
TARE_SAMPLES = 4096  # more than any sensor sends during a tare
# A simulation shares its thread with plant and recorder; only real arms need cadence.
LATE_WHEN_SIMULATED = 250
# On the wall clock the simulated safety module lives in the loop's own process, so a
# stall of the machine stops both: it must not look like a lost heartbeat.
HEARTBEAT_IN_PROCESS_NS = 1_000_000_000


@dataclass(frozen=True, slots=True)
class FakeOptions:
    """How a simulated session runs: stepped time or the wall clock, and the seed."""

    is_fast: bool
    seed: int


@dataclass(slots=True)
class Rig:
    """Everything a session needs, real or simulated, already connected.

    Attributes:
        clock: the time of loop and devices.
        arm: driver of the arm, not started.
        open_sensor_port: opens the serial port of the wrist sensor.
        foot: live view of the foot; its payload is replaced by each tare.
        payload: what the sensor carries, not tared.
        model: the arm with its tool.
        tape: the last two seconds of frames.
        wrenches: the sensor's newest samples, for the tare; the oldest are forgotten.
        frame: where the container stands.
        row: row of the matrix.
        settings: all settings.
        can_link: the arm's bus, for those who listen in.
        rehearsal: handle of the simulation; None on the real rig.
        is_stepped: time passes only while the loop runs.
    """

    clock: Clock
    arm: WamArm
    open_sensor_port: Callable[[], SerialPort]
    foot: LiveFoot
    payload: Payload
    model: ArmModel
    tape: FrameTape
    wrenches: deque[WrenchSample]
    frame: TerrainFrame
    row: TerrainRow
    settings: Settings
    can_link: CanLink
    rehearsal: Rehearsing | None
    is_stepped: bool

    @property
    def is_simulated(self) -> bool:
        """Whether the devices are simulated."""
        return self.rehearsal is not None

    def open_sensor(self) -> WrenchSensor:
        """Open the wrist sensor and let it begin; on the arm's bus it goes along.

        Raises:
            LinkError: the port cannot be opened, or the sensor is silent.
            DeviceFaultError: the sensor refuses its settings, or is not well.
        """
        section = self.settings.rig.ft_sensor
        if section.kind == "barrett":
            on_bus = BarrettSensor(self.can_link, self.clock)
            on_bus.open()
            self.arm.accompany(on_bus)
            return on_bus
        settings = SensorSettings(
            "simulated" if self.is_simulated else section.port,
            baudrate=section.baudrate,
            sinc=section.sinc,
            rate_check=0.5 if self.is_simulated else 2.0,
        )
        sensor = BotaSensor(SerialLink(self.open_sensor_port()), self.clock, settings)
        sensor.open()
        return sensor

    def connect(self, sensor: WrenchSensor) -> InlineControl:
        """Join arm, sensor, law and guard into a loop that is ready to run."""
        ring = SampleRing()
        recorder = Recorder(ring, self.clock)

        def on_wrench(samples: list[WrenchSample]) -> None:
            recorder.add_wrenches(samples)
            self.wrenches.extend(samples)

        control = self.settings.rig.control
        gains = LockGains(kp=control.lock_kp, kd=control.lock_kd)
        limits = build_limits(self.settings.rig, self.model.constants)
        if self.is_simulated:
            limits = replace(limits, late_per_second=LATE_WHEN_SIMULATED)
        cycle = Cycle(
            self.arm,
            sensor,
            FootController(self.model, control.virtual_mass, gains),
            self.foot,
            limits,
            ring.write,
            on_wrench,
            extra_flags=Flag.SIMULATED if self.is_simulated else 0,
        )
        return InlineControl(Loop(cycle, self.clock), cycle, recorder, ring)


def terrain_frame(row: TerrainRow) -> TerrainFrame:
    """Return the frame of a row of the matrix."""
    return TerrainFrame(
        incline=float(np.radians(row.incline_deg)),
        heading=float(np.radians(row.heading_deg)),
        far_end=row.far_end,
        travel=row.travel,
    )


def build_tool(rig: RigSettings, foot: str) -> Tool:
    """Return sensor and foot as rig.toml describes them."""
    section: FootSection = rig.feet.tread if foot == "tread" else rig.feet.bare
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


def build_limits(rig: RigSettings, constants: ArmConstants) -> Limits:
    """Return the guard's limits of rig.toml."""
    limits = rig.limits
    return Limits(
        q_lower=constants.q_lower,
        q_upper=constants.q_upper,
        qd=np.array(limits.speed),
        tau=np.array(limits.torque),
        foot_speed=limits.foot_speed,
        joint7=limits.joint7_mrad * 1e-3,
        ft_stale_ns=round(limits.ft_stale_ms * MS),
        ft_stop_ns=round(limits.ft_stop_ms * MS),
        late_per_second=limits.late_per_second,
    )


def build_safety_limits(rig: RigSettings) -> SafetyLimits:
    """Return what the safety module is told; see [safety] of rig.toml."""
    safety = rig.safety
    speed, torque = safety.speed_warning, safety.torque_warning_units
    if speed is None:
        speed = WARNING_SHARE * safety.speed_fault
    if torque is None:
        torque = int(WARNING_SHARE * safety.torque_fault_units)
    return SafetyLimits(speed, safety.speed_fault, torque, safety.torque_fault_units)


def build_rig(settings: Settings, row: TerrainRow, fake: FakeOptions | None) -> Rig:
    """Return the rig for one session.

    Raises:
        LinkError: the CAN interface cannot be opened (real rig).
    """
    constants = load_constants()
    tool = build_tool(settings.rig, row.foot)
    frame = terrain_frame(row)
    sensor = settings.rig.ft_sensor
    rehearsal: Rehearsing | None = None
    if fake is None:
        clock: Clock = SystemClock()
        can = settings.rig.can
        bus = open_bus(can.interface, can.channel, can.bitrate)

        def open_sensor_port() -> SerialPort:
            return open_port(sensor.port, sensor.baudrate).port

    else:
        clock, simulation, rehearsal = _simulate(settings, row, fake, constants, tool)
        bus = simulation.bus
        open_sensor_port = simulation.open_port
    tape = FrameTape()
    model = ArmModel(constants, tool)
    payload = payload_of(tool)
    can_link = CanLink(bus)
    return Rig(
        clock=clock,
        arm=WamArm(
            TappedLink(can_link, tape, clock),
            clock,
            ArmSettings(
                j2mp=constants.j2mp,
                safety_limits=build_safety_limits(settings.rig),
            ),
        ),
        open_sensor_port=open_sensor_port,
        foot=LiveFoot(model, payload, frame),
        payload=payload,
        model=model,
        tape=tape,
        wrenches=deque(maxlen=TARE_SAMPLES),
        frame=frame,
        row=row,
        settings=settings,
        can_link=can_link,
        rehearsal=rehearsal,
        is_stepped=fake is not None and fake.is_fast,
    )


def _simulate(
    settings: Settings,
    row: TerrainRow,
    fake: FakeOptions,
    constants: ArmConstants,
    tool: Tool,
) -> tuple[Clock, FakeRig, Rehearsing]:
    """Return (clock, simulated rig, its handle); only here are the fakes imported."""
    from fakes.clock import SteppedClock
    from fakes.network_options import NetworkOptions
    from fakes.rig import FakeRig, Rehearsal, Scene

    network = NetworkOptions(has_sensor=settings.rig.ft_sensor.kind == "barrett")
    scene = Scene(
        terrain=row.name,
        stones=row.stones,
        foot=row.foot,
        frame=terrain_frame(row),
        start_q=np.array(row.start_q),
        seed=fake.seed,
    )
    if not fake.is_fast:
        clock = SystemClock()
        network = replace(network, heartbeat_ns=HEARTBEAT_IN_PROCESS_NS)
        rig = FakeRig(scene, constants, tool, clock, network=network)
        return clock, rig, Rehearsal(rig)
    stepped = SteppedClock()
    rig = FakeRig(scene, constants, tool, stepped, network=network)
    stepped.world = rig
    return stepped, rig, Rehearsal(rig)


def build_server(
    settings: Settings, interface: str, channel: str, *, is_idle_first: bool
) -> PuckServer:
    """Return a simulated arm that serves its pucks to other programs.

    The arm is at its home position, where an operator puts it before zeroing.

    Args:
        settings: all settings; the first terrain of the matrix names the foot.
        interface: "traction-fake" or an interface of python-can.
        channel: path of the socket, or the interface's channel.
        is_idle_first: powered, idle, pucks asleep; otherwise in E-STOP.

    Raises:
        SettingsError: the socket's path is in use or cannot be one.
        LinkError: the bus cannot be opened.
    """
    from fakes.serve import build_home_server, open_can_port

    row = settings.matrix.terrains[0]
    port = open_can_port(interface, channel, settings.rig.can.bitrate)
    tool = build_tool(settings.rig, row.foot)
    return build_home_server(
        port, tool, terrain_frame(row), SystemClock(), is_idle_first=is_idle_first
    )
