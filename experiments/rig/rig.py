"""Composition root: builds a rig from settings and a row of the matrix."""

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
    SimulatedRig,
    TrueDeviations,
    stepped,
    with_typing_error,
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
    """Options of a simulated session.

    Attributes:
        mode: stepped time paced to real time or at full speed, or the processes of the
            real rig.
        seed: seed of all random numbers.
        friction: joint friction as a share of that identified on another arm.
        pace: style of the simulated person's push, a name of `fakes.plant.push.PACES`.
        cables: resonance of the joints on their cables [Hz]; None = stiff cables.
        spread: whether the rig is drawn from the population of sound ones, by the seed;
            always for a wrong one.
        mount: true rotations of the base about x, then y, then z [degrees], unknown to
            the program; None = as in the settings.
        wrong: name of the defect in the catalogue of wrong rigs; "" = none.
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
    def truth(self) -> TrueDeviations | None:
        """True deviations of the rig from its settings; None = none."""
        if not (self.spread or self.wrong or self.mount):
            return None
        spread = self.spread or bool(self.wrong)
        return TrueDeviations(spread, self.mount or (0.0, 0.0, 0.0), self.wrong)


@dataclass(slots=True)
class Rig:
    """Everything a session needs, real or simulated.

    Attributes:
        clock: the console's clock.
        backend: access to bus, sensor and loop.
        shared: the shared memory.
        model: the arm with its tool.
        law_model: gravity model of the control law.
        payload: load of the sensor, not tared.
        tared: payload with the bias of the latest tare.
        serials: serial numbers of the seven pucks from the preflight; None = unknown.
        tared_ns: time of the latest tare [ns]; 0 = never.
        frame: terrain frame.
        row: row of the matrix.
        settings: all settings.
        calibrations: texts of the gravity and friction calibrations.
        simulation: handle of the simulation; None on the real rig.
        pace: pacing of stepped time to real time; None on a real-time clock.
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
    """Build the rig of one session: stepped in this thread, or in processes.

    Raises:
        SettingsError: a calibration cannot be used, or a number is not permitted on a
            real arm.
        LinkError: a process cannot open its bus or port.
        PreflightError: another program has the arm.
    """
    if fake is None:
        settings.check_real()
    is_simulated = fake is not None
    world: SimulatedRig | None = None
    if fake is not None:  # the simulation is built from uncalibrated settings
        world = _world(settings, row.name, fake)
    if fake is not None and fake.wrong:
        settings = with_typing_error(settings, fake.wrong)
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
        law_model=law.gravity_model,
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
    """Return the multi-process backend; a shared bus is locked first."""
    if jobs.fake is not None:  # private bus
        return MultiProcessBackend(jobs, shared, clock)
    can = settings.rig.can
    lock = ArmLock(can.interface, can.channel)
    try:
        return MultiProcessBackend(jobs, shared, clock, lock)
    except BaseException:
        lock.close()
        raise


def _terminal() -> str:
    """Return the path of the console's terminal, "" if it has none."""
    try:
        return os.ttyname(2)
    except OSError:  # no terminal, or one without a name
        return ""


def _jobs(
    settings: Settings,
    row: TerrainRow,
    calibrations: LawCalibrations,
    world: dict[str, Any] | None,
) -> WorkerConfigs:
    """Return the settings of the processes; `world` is that of the simulated rig."""
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
        # A simulated arm has factory properties and no history.
        "properties": read_properties(settings) if world is None else "",
        "lost_positions": str(lost) if world is None else "",
        "can": rig.can.model_dump(mode="json"),
        "terminal": _terminal(),
    }
    sensor = rig.ft_sensor
    reader = None if sensor.is_on_bus else {**common, "port": sensor.port}
    return WorkerConfigs(control, reader, world)
