"""The composition root: settings and a row of the matrix in, a rig out."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

from acquisition.clock import Clock, SystemClock
from acquisition.ipc.layout import SharedLayout
from acquisition.ipc.simulation import RemoteSimulation
from acquisition.simulation import SimulationControl
from experiments.arguments import FRICTION, TimeMode
from experiments.rig.arm_lock import ArmLock
from experiments.rig.backend import RigBackend
from experiments.rig.build import (
    LOST_POSITIONS,
    build_tool,
    read_properties,
    terrain_frame,
)
from experiments.rig.fake import (
    RigTruth,
    SimulatedRig,
    stepped,
    typed_wrongly,
)
from experiments.rig.law_calibrations import (
    LawCalibrations,
    build_law,
    read_law_calibrations,
)
from experiments.rig.pace import WallPace
from experiments.rig.processes import MultiProcessBackend, WorkerConfigs
from experiments.settings.calibrations import with_calibrations
from experiments.settings.load import Settings
from experiments.settings.matrix import TerrainRow
from ft_sensor.payload import Payload, TerrainFrame, payload_of
from wam.model.arm_model import ArmModel


@dataclass(frozen=True, slots=True)
class FakeOptions:
    """How a simulated session runs.

    Attributes:
        mode: stepped time at the pace of the wall, as fast as it can, or the processes
            of the real rig.
        seed: of everything random.
        friction: of the joints, as a share of what was identified on another arm.
        pace: how the simulated person pushes, a name of `fakes.plant.push.PACES`.
        cables: resonance of the joints on their cables [Hz]; None = stiff ones.
        spread: the rig is one of many sound ones, drawn by the seed; a wrong one is
            always.
        mount: turns of the true base about x, then y, then z [degrees], which the
            program does not know; None = as it believes.
        wrong: name of what is wrong with the rig in the catalogue of wrong rigs; "" =
            nothing.
    """

    mode: TimeMode
    seed: int
    friction: float = FRICTION
    pace: str = "steady"
    cables: float | None = None
    spread: bool = False
    mount: tuple[float, float, float] | None = None
    wrong: str = ""

    @property
    def truth(self) -> RigTruth | None:
        """What is true of the rig, but not believed; None = nothing."""
        if not (self.spread or self.wrong or self.mount):
            return None
        spread = self.spread or bool(self.wrong)
        return RigTruth(spread, self.mount or (0.0, 0.0, 0.0), self.wrong)


@dataclass(slots=True)
class Rig:
    """Everything a session needs, real or simulated.

    Attributes:
        clock: the console's time.
        backend: serves bus, sensor and loop.
        shared: the memory that the processes share.
        model: the arm with its tool.
        law_model: the same as the control law weighs it.
        payload: what the sensor carries, not tared.
        tared: the same with the bias of the newest tare.
        serials: of the seven pucks, as the preflight read them; None = unknown.
        tared_ns: when that was taken [ns]; 0 = never.
        frame: where the container stands.
        row: row of the matrix.
        settings: all settings.
        calibrations: of gravity and friction.
        simulation: handle of the simulation; None on the real rig.
        pace: of stepped time, against the wall's; None where that is the clock.
    """

    clock: Clock
    backend: RigBackend
    shared: SharedLayout
    model: ArmModel
    law_model: ArmModel
    payload: Payload
    tared: Payload
    frame: TerrainFrame
    row: TerrainRow
    settings: Settings
    calibrations: LawCalibrations
    simulation: SimulationControl | None
    pace: WallPace | None = None
    serials: tuple[int, ...] | None = None
    tared_ns: int = 0

    @property
    def is_simulated(self) -> bool:
        """Whether the devices are simulated."""
        return self.simulation is not None

    @property
    def is_stepped(self) -> bool:
        """Whether time passes only while the loop runs."""
        return self.pace is not None


def build_rig(settings: Settings, row: TerrainRow, fake: FakeOptions | None) -> Rig:
    """Return the rig for one session: on stepped time in this thread, else processes.

    Raises:
        SettingsError: a calibration cannot be used, or a number is none of a real arm.
        LinkError: a process cannot open its bus or port.
        PreflightError: another program has the arm.
    """
    if fake is None:
        settings.check_real()
    is_simulated = fake is not None
    world: SimulatedRig | None = None
    if fake is not None:  # a simulated world does not know what was calibrated
        world = _world(settings, row.name, fake)
    if fake is not None and fake.wrong:
        settings = typed_wrongly(settings, fake.wrong)
    settings = with_calibrations(settings, is_simulated=is_simulated)
    calibrations = read_law_calibrations(settings)
    row = settings.row(row.name)
    law = build_law(settings.rig, calibrations, row.foot, is_simulated=is_simulated)
    shared = SharedLayout.create()
    simulation: SimulationControl | None = None
    pace: WallPace | None = None
    if world is not None and fake is not None and fake.mode != "processes":
        clock, backend, simulation = stepped(world, settings, row, law, shared)
        pace = WallPace(clock, SystemClock())
        if fake.mode == "paced":
            backend.loop_client.on_tick.append(pace.keep)
    else:
        fields = world.metadata() if world is not None else None
        clock = SystemClock()
        shared.memory.touch()
        jobs = _jobs(settings, row, calibrations, fields)
        backend = _start_processes(jobs, settings, shared, clock)
        if backend.fake is not None:
            simulation = RemoteSimulation(backend.fake.ask)
    payload = payload_of(build_tool(settings.rig, row.foot))
    return Rig(
        clock=clock,
        backend=backend,
        shared=shared,
        model=law.model,
        law_model=law.weighed,
        payload=payload,
        tared=payload,
        frame=terrain_frame(row),
        row=row,
        settings=settings,
        calibrations=calibrations,
        simulation=simulation,
        pace=pace,
    )


def _world(settings: Settings, terrain: str, fake: FakeOptions) -> SimulatedRig:
    return SimulatedRig(
        rig=settings.rig,
        row=settings.row(terrain),
        seed=fake.seed,
        friction=fake.friction,
        pace=fake.pace,
        cables=fake.cables,
        truth=fake.truth,
    )


def _start_processes(
    jobs: WorkerConfigs, settings: Settings, shared: SharedLayout, clock: Clock
) -> MultiProcessBackend:
    """Return the backend in processes; a bus that others may open is locked first."""
    if jobs.fake is not None:  # its bus is its own
        return MultiProcessBackend(jobs, shared, clock)
    can = settings.rig.can
    lock = ArmLock(can.interface, can.channel)
    try:
        return MultiProcessBackend(jobs, shared, clock, lock)
    except BaseException:
        lock.close()
        raise


def _terminal() -> str:
    """Return the path of the console's terminal, "" where it has none."""
    try:
        return os.ttyname(2)
    except OSError:  # none, or one without a name: a serial console, another mount
        return ""


def _jobs(
    settings: Settings,
    row: TerrainRow,
    calibrations: LawCalibrations,
    world: dict[str, Any] | None,
) -> WorkerConfigs:
    """Return the settings of the processes; `world` is of the simulated rig."""
    rig, lost = settings.rig, settings.folder / LOST_POSITIONS
    common: dict[str, Any] = {
        "rig": rig.model_dump(mode="json"),
        "is_simulated": world is not None,
    }
    control = {
        **common,
        "row": row.model_dump(mode="json"),
        "gravity": calibrations.gravity,
        "friction": calibrations.friction,
        # A simulated arm is as it left the factory, and has no past.
        "properties": read_properties(settings) if world is None else "",
        "lost_positions": str(lost) if world is None else "",
        "can": rig.can.model_dump(mode="json"),
        "terminal": _terminal(),
    }
    sensor = rig.ft_sensor
    reader = None if sensor.is_on_bus else {**common, "port": sensor.port}
    return WorkerConfigs(control, reader, world)
