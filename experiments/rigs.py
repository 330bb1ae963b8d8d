"""The composition root: settings and a row of the matrix in, a rig out."""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from acquisition.board import Board
from acquisition.clock import Clock, SystemClock
from acquisition.devices import WrenchSensor
from experiments.crews import Crew, InlineCrew, Jobs, ProcessCrew
from experiments.gravity_choice import build_law_model, read_gravity
from experiments.parts import (
    LoopParts,
    build_arm,
    build_sensor,
    build_tool,
    open_bus_sensor,
    terrain_frame,
)
from experiments.rehearsing import Rehearsing, RemoteRehearsal
from experiments.settings import Settings, TerrainRow
from ft_sensor.payload import Payload, TerrainFrame, payload_of
from wam.can_link import CanLink
from wam.constants import load_constants
from wam.model import ArmModel
from wam.tool import tool_facts

if TYPE_CHECKING:
    from fakes.serve import PuckServer


@dataclass(frozen=True, slots=True)
class FakeOptions:
    """How a simulated session runs: stepped time or the wall clock, and the seed."""

    is_fast: bool
    seed: int


@dataclass(slots=True)
class Rig:
    """Everything a session needs, real or simulated.

    Attributes:
        clock: the console's time.
        crew: who works the rig.
        board: the memory they share.
        model: the arm with its tool.
        payload: what the sensor carries, not tared.
        tared: the same with the bias of the newest tare.
        frame: where the container stands.
        row: row of the matrix.
        settings: all settings.
        gravity_text: the gravity calibration in use; empty for none.
        rehearsal: handle of the simulation; None on the real rig.
        is_stepped: time passes only while the loop runs.
    """

    clock: Clock
    crew: Crew
    board: Board
    model: ArmModel
    payload: Payload
    tared: Payload
    frame: TerrainFrame
    row: TerrainRow
    settings: Settings
    gravity_text: str
    rehearsal: Rehearsing | None
    is_stepped: bool

    @property
    def is_simulated(self) -> bool:
        """Whether the devices are simulated."""
        return self.rehearsal is not None


def build_rig(settings: Settings, row: TerrainRow, fake: FakeOptions | None) -> Rig:
    """Return the rig for one session: on stepped time in this thread, else processes.

    Raises:
        SettingsError: the gravity calibration cannot be used.
        LinkError: a process cannot open its bus or port.
    """
    tool = build_tool(settings.rig, row.foot)
    model = ArmModel(load_constants(), tool)
    gravity_text = read_gravity(settings)
    law_model = build_law_model(
        settings.rig, gravity_text, row.foot, is_simulated=fake is not None
    )
    board = Board.create()
    rehearsal: Rehearsing | None = None
    if fake is not None and fake.is_fast:
        clock, crew, rehearsal = _stepped(
            settings, row, fake.seed, (model, law_model), board
        )
    else:
        clock = SystemClock()
        crew = ProcessCrew(_jobs(settings, row, fake, gravity_text), board, clock)
        if crew.fake is not None:
            rehearsal = RemoteRehearsal(crew.fake)
    payload = payload_of(tool)
    return Rig(
        clock=clock,
        crew=crew,
        board=board,
        model=model,
        payload=payload,
        tared=payload,
        frame=terrain_frame(row),
        row=row,
        settings=settings,
        gravity_text=gravity_text,
        rehearsal=rehearsal,
        is_stepped=fake is not None and fake.is_fast,
    )


def _jobs(
    settings: Settings, row: TerrainRow, fake: FakeOptions | None, gravity_text: str
) -> Jobs:
    rig = settings.rig
    common: dict[str, Any] = {
        "rig": rig.model_dump(mode="json"),
        "is_simulated": fake is not None,
    }
    control = {
        **common,
        "row": row.model_dump(mode="json"),
        "gravity": gravity_text,
        "can": rig.can.model_dump(mode="json"),
        "terminal": os.ttyname(2) if sys.stderr.isatty() else "",
    }
    is_on_bus = rig.ft_sensor.kind == "barrett"
    reader = None if is_on_bus else {**common, "port": rig.ft_sensor.port}
    simulated: dict[str, Any] | None = None
    if fake is not None:
        simulated = {
            "scene": _scene_facts(row, fake.seed),
            "tool": tool_facts(build_tool(rig, row.foot)),
            "has_sensor": is_on_bus,
        }
    return Jobs(control, reader, simulated)


def _scene_facts(row: TerrainRow, seed: int) -> dict[str, Any]:
    frame = terrain_frame(row)
    return {
        "terrain": row.name,
        "stones": row.stones,
        "foot": row.foot,
        "frame": {
            "incline": frame.incline,
            "heading": frame.heading,
            "far_end": list(frame.far_end),
            "travel": frame.travel,
        },
        "start_q": list(row.start_q),
        "seed": seed,
    }


def _stepped(
    settings: Settings,
    row: TerrainRow,
    seed: int,
    models: tuple[ArmModel, ArmModel],
    board: Board,
) -> tuple[Clock, Crew, Rehearsing]:
    """Return (clock, crew, handle) of a simulation that runs in this thread."""
    from fakes.clock import SteppedClock
    from fakes.network_options import NetworkOptions
    from fakes.rig import FakeRig, Rehearsal
    from fakes.station import scene_of

    clock = SteppedClock()
    model, law_model = models
    assert model.tool is not None
    scene = scene_of(_scene_facts(row, seed))
    is_on_bus = settings.rig.ft_sensor.kind == "barrett"
    network = NetworkOptions(has_sensor=is_on_bus)
    simulation = FakeRig(scene, model.constants, model.tool, clock, network=network)
    clock.world = simulation
    link = CanLink(simulation.bus)
    arm = build_arm(settings.rig, model.constants, link, board, clock)

    def sensor() -> WrenchSensor:
        if is_on_bus:
            return open_bus_sensor(arm, link, clock)
        port = simulation.open_port()
        serial = build_sensor(settings.rig, port, clock, is_simulated=True)
        serial.open()
        return serial

    def parts(opened: WrenchSensor) -> LoopParts:
        return LoopParts(
            rig=settings.rig,
            row=row,
            model=model,
            law_model=law_model,
            arm=arm,
            sensor=opened,
            board=board,
            clock=clock,
            is_simulated=True,
        )

    crew = InlineCrew(board, clock, arm, sensor, parts)
    return clock, crew, Rehearsal(simulation)


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
