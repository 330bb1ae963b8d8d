"""Simulated rigs: their settings, stepped simulation, and served arms."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from acquisition.clock import Clock, SystemClock
from acquisition.devices import WrenchSensor
from acquisition.errors import SettingsError
from acquisition.ipc.layout import SharedLayout
from acquisition.simulation import SimulationControl
from experiments.rig.arm_service import ArmAccess, ArmService
from experiments.rig.backend import InProcessBackend, RigBackend
from experiments.rig.build import (
    LawParts,
    LoopConfig,
    build_arm,
    build_link,
    build_sensor,
    build_tool,
    open_bus_sensor,
    start_of,
    terrain_frame,
    tool_with,
)
from experiments.settings.load import Settings, read_foot
from experiments.settings.matrix import TerrainRow
from experiments.settings.rig import RigSettings
from ft_sensor.serial_line.link import SerialPort
from ft_sensor.serial_line.sensor import SerialSensor
from ft_sensor.vendors.registry import AnySensor
from wam.bus.link import CanLink
from wam.driver.arm import WamArm
from wam.model.arm_model import ArmModel
from wam.model.constants import load_constants
from wam.model.tool import Tool, tool_metadata

if TYPE_CHECKING:
    from fakes.serving.puck_server import PuckServer
    from fakes.serving.sensor_server import SensorLine, SensorServer


@dataclass(frozen=True, slots=True)
class TrueDeviations:
    """True deviations of a simulated rig from its settings.

    Attributes:
        spread: whether the rig is drawn from the population of sound ones, by the seed:
            zeros, stops, mounting and sensor are nearly those of the drawings.
        mount: rotations of its base about x, then y, then z [degrees].
        wrong: name of its defect in the catalogue; "" = none.
    """

    spread: bool = False
    mount: tuple[float, float, float] = (0.0, 0.0, 0.0)
    wrong: str = ""


@dataclass(frozen=True, slots=True)
class SimulatedRig:
    """Settings of a simulation, before any calibration.

    Attributes:
        rig: rig.toml.
        row: row of the matrix.
        seed: seed of all random numbers.
        friction: joint friction as a share of that identified on another arm.
        pace: style of the simulated person's push.
        cables: resonance of the joints on their cables [Hz]; None = stiff cables.
        truth: true deviations of the rig; None = none.
    """

    rig: RigSettings
    row: TerrainRow
    seed: int
    friction: float
    pace: str
    cables: float | None = None
    truth: TrueDeviations | None = None

    def metadata(self) -> dict[str, Any]:
        """Return the simulation as plain values, for another process."""
        row, tool = self.row, build_tool(self.rig, self.row.foot)
        frame, sole = terrain_frame(row), self.rig.feet[row.foot].simulate
        start = start_of(row, ArmModel(load_constants(), tool))
        scene = {
            "terrain": row.name,
            "stones": row.stones,
            "foot": row.foot,
            "effects": dict(row.simulate),
            "sole": None if sole is None else sole.model_dump(),
            "frame": {
                "incline": frame.incline,
                "heading": frame.heading,
                "far_end": list(frame.start),
                "travel": frame.travel,
            },
            "start_q": start.tolist(),
            "seed": self.seed,
            "sensor": sensor_metadata(self.rig.ft_sensor),
            "truth": None if self.truth is None else asdict(self.truth),
        }
        return {
            "scene": scene,
            "tool": tool_metadata(tool),
            "friction": self.friction,
            "pace": self.pace,
            "cables": self.cables,
        }


def wrong_rigs() -> dict[str, str]:
    """Return fault and cause of each faulty rig of the catalogue, by name."""
    from fakes.world.wrong_rigs import catalogue

    return {name: f"{rig.fault} ({rig.cause})" for name, rig in catalogue().items()}


def with_typing_error(settings: Settings, wrong: str) -> Settings:
    """Return the settings with the typing error of a faulty rig, if it has one.

    Raises:
        SettingsError: there is no such rig, or rig.toml would be refused with the
            typing error.
    """
    from fakes.world.wrong_rigs import wrong_rig

    mass = wrong_rig(wrong).deviation.typed_foot_mass
    return settings if mass is None else settings.with_foot_mass(mass)


def sensor_metadata(section: AnySensor) -> dict[str, Any]:
    """Return the options of the simulated sensor as plain values."""
    options = {"kind", "sinc", "baudrate", "sensitivity", "serial_number", "rate"}
    options |= {"counts_per_force", "counts_per_torque"}
    return section.model_dump(include=options)


def stepped(
    world: SimulatedRig,
    settings: Settings,
    row: TerrainRow,
    law: LawParts,
    shared: SharedLayout,
) -> tuple[Clock, RigBackend, SimulationControl]:
    """Return (clock, backend, handle) of a simulation in this thread, under `law`."""
    from fakes.bus.in_process import InProcessTransport
    from fakes.clock import SteppedClock
    from fakes.world.plain_world import simulated_rig

    clock = SteppedClock()
    constants = law.model.constants
    simulation = simulated_rig(world.metadata(), constants, clock)
    simulated = simulation.rig
    clock.attach(simulated)
    link = build_link(InProcessTransport(simulated.bus, clock), shared, clock)
    arm = build_arm(settings.rig, constants, link, clock)

    def opened_sensor(arm: WamArm, link: CanLink) -> WrenchSensor:
        if settings.rig.ft_sensor.is_on_bus:
            return open_bus_sensor(arm, link, clock)
        return _opened_sensor(settings.rig, simulated.open_port(), clock)

    def loop_config(arm: WamArm, sensor: WrenchSensor) -> LoopConfig:
        return LoopConfig(
            rig=settings.rig,
            row=row,
            law=law,
            arm=arm,
            sensor=sensor,
            shared=shared,
            clock=clock,
            is_simulated=True,
        )

    access = ArmAccess(
        open_bus=lambda: (arm, link),
        check=lambda arm, link: None,  # private bus
        open_sensor=opened_sensor,
        loop_config=loop_config,
    )
    backend = InProcessBackend(shared, clock, ArmService(access, clock))
    return clock, backend, simulation


def _opened_sensor(rig: RigSettings, port: SerialPort, clock: Clock) -> SerialSensor:
    sensor = build_sensor(rig, port, clock, is_simulated=True)
    sensor.open()
    return sensor


def _sensor_line(settings: Settings, path: Path, kind: str) -> SensorLine:
    """Return a serial sensor of `kind` at `path`, with rig.toml's options."""
    from fakes.sensor.kinds import SensorChoice
    from fakes.serving.sensor_server import SensorLine

    section = settings.rig.ft_sensor
    fields: dict[str, Any] = {"kind": kind}
    if section.kind == kind:
        fields = sensor_metadata(section)
    return SensorLine(path, SensorChoice(**fields))


NO_TOOL = "none"


@dataclass(frozen=True, slots=True)
class ServedArm:
    """Options of an arm served to other programs.

    Attributes:
        bus: "traction-fake" or an interface of python-can, and its channel.
        line: path and kind of a serial sensor; None = the sensor is on the bus.
        is_idle_first: whether the arm starts powered, idle, pucks asleep; otherwise in
            E-STOP.
        tool: a foot of rig.toml, "none", or the path of a foot's file; empty for the
            foot of the first terrain.
        has_hand: whether a simulated person carries the arm.
        firmware: versions of motor pucks and safety module.
        is_at_rest: whether joint 6 lies on its upper stop, the others at home.
        friction: share of joint friction; None = default for `has_hand`.
        seed: seed of a sound arm; None = that of the drawings.
        truth: true deviations of the arm; None = none.
    """

    bus: tuple[str, str]
    line: tuple[Path, str] | None
    is_idle_first: bool
    tool: str
    has_hand: bool
    firmware: tuple[int, int]
    is_at_rest: bool = False
    friction: float | None = None
    seed: int | None = None
    truth: TrueDeviations | None = None


def _served_tool(settings: Settings, tool: str) -> Tool | None:
    """Return the tool on the plate; `tool` as in `ServedArm`.

    Raises:
        SettingsError: its file cannot be read or is invalid.
    """
    if tool == NO_TOOL:
        return None
    if not tool or tool in settings.rig.feet:
        foot = tool or settings.matrix.terrains[0].foot
        return build_tool(settings.rig, foot)
    return tool_with(settings.rig, read_foot(Path(tool)))


def build_sensor_server(
    settings: Settings, line: tuple[Path, str], tool: str
) -> SensorServer:
    """Return a served serial sensor without arm, carrying a foot.

    Args:
        settings: all settings.
        line: path and kind of the sensor.
        tool: as in `ServedArm`.

    Raises:
        SettingsError: the path is in use or invalid, or there is no tool.
    """
    from fakes.serving.sensor_server import SensorServer, hanging_load

    hanging = _require_tool(_served_tool(settings, tool))
    served = _sensor_line(settings, *line)
    return SensorServer(served, hanging_load(hanging), SystemClock())


def _require_tool(tool: Tool | None) -> Tool:
    if tool is None:
        raise SettingsError(
            "Without a tool there is no wrist sensor to serve.",
            hint="Leave out --serial or --tool none. Nothing was started.",
        )
    return tool


def build_server(settings: Settings, served: ServedArm) -> PuckServer:
    """Return a simulated arm that serves its pucks to other programs.

    The arm is at its home position, as before zeroing.

    Raises:
        SettingsError: the socket's path is in use or invalid, or the tool is wrong.
        LinkError: the bus cannot be opened.
    """
    from fakes.serving.home_arm import HomePose, build_home_server
    from fakes.serving.puck_server import open_can_port
    from fakes.world.plain_world import deviation_from

    truth = None if served.truth is None else asdict(served.truth)
    tool, line = _served_tool(settings, served.tool), None
    if served.line is not None:
        _require_tool(tool)
        line = _sensor_line(settings, *served.line)
    home = HomePose(
        tool,
        terrain_frame(settings.matrix.terrains[0]),
        line,
        served.is_idle_first,
        served.has_hand,
        served.firmware,
        served.is_at_rest,
        served.friction,
        served.seed,
        deviation_from(truth, 1 if served.seed is None else served.seed),
    )
    port = open_can_port(*served.bus, settings.rig.can.bitrate)
    try:
        return build_home_server(port, home, SystemClock())
    except SettingsError:
        port.close()
        raise
