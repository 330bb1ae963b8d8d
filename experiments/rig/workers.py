"""The processes beside the console: one drives the arm, one reads the sensor."""

from __future__ import annotations

import contextlib
import os
import signal
from pathlib import Path

from acquisition.clock import SystemClock
from acquisition.control_loop.loop import Loop
from acquisition.control_loop.realtime import Grant, RealtimeRequest, request
from acquisition.devices import WrenchSensor
from acquisition.errors import TractionError
from acquisition.ipc.channel import ChannelClosedError
from acquisition.ipc.child import ChildContext, name_process
from acquisition.ipc.layout import ProcessRole
from acquisition.ipc.loop_server import LoopServer
from acquisition.ipc.rpc import RpcServer, bind
from acquisition.ipc.shared_sensor import SharedSensor, publish
from experiments.rig.arm_operations import ArmOperations
from experiments.rig.build import (
    LoopConfig,
    build_arm,
    build_link,
    build_loop_server,
    build_sensor,
    open_bus_sensor,
)
from experiments.rig.claim import check_alone, check_inactive, release
from experiments.rig.law_calibrations import LawCalibrations, build_law
from experiments.rig.services import ControlService, SensorService
from experiments.settings.matrix import TerrainRow
from experiments.settings.rig import RigSettings
from ft_sensor.serial_line.reconnect import ReconnectingSensor, stream_metadata
from ft_sensor.serial_line.sensor import SerialSensor
from wam.bus.link import CanLink
from wam.bus.transports import open_transport
from wam.driver.arm import WamArm

CONTROL_PRIORITY = 80
READER_PRIORITY = 60
READ_NS = 20_000_000  # the reader shows being alive this often


def control(context: ChildContext) -> None:
    """Drive the arm: answer the console, then run the loop until it says so."""
    name_process("traction-control")
    ControlWorker(context).serve()


class ControlWorker:
    """The process that drives the arm, one thread; implements `ControlService`."""

    def __init__(self, context: ChildContext) -> None:
        settings = context.settings
        self._context = context
        self._rig = RigSettings.model_validate(settings["rig"])
        self._clock = SystemClock(round(self._rig.loop.spin_us * 1e3))
        self._row = TerrainRow.model_validate(settings["row"])
        self._is_simulated = bool(settings["is_simulated"])
        self._law = build_law(
            self._rig,
            LawCalibrations(settings["gravity"], settings["friction"]),
            self._row.foot,
            is_simulated=self._is_simulated,
        )
        self._constants = self._law.model.constants
        self._arm: WamArm | None = None
        self._link: CanLink | None = None
        self._sensor: WrenchSensor = SharedSensor(context.shared.wrenches)
        self._loop_server: LoopServer | None = None
        self._is_orphaned = False
        signal.signal(signal.SIGTERM, self._note_orphaned)
        core = settings.get("core")
        wish = RealtimeRequest(CONTROL_PRIORITY, core, is_locked=True, is_awake=True)
        self._grants = request(wish)

    def serve(self) -> None:
        """Answer until the console hangs up; an arm that got torques is idled then."""
        server = RpcServer(
            bind(ArmOperations, ArmOperations(self._opened, self._clock)),
            bind(ControlService, self),
        )
        try:
            while not self._is_orphaned:
                server.answer(self._context.channel)
                if self._loop_server is not None:
                    self._run(self._loop_server)
                    self._loop_server = None
        except ChannelClosedError:
            pass
        finally:
            self._release()

    def claim(self) -> None:
        """Open the bus and refuse an arm that is another program's.

        Raises:
            PreflightError: another master talks, or the arm is active.
            LinkError: the bus cannot be opened, or is down.
        """
        arm = self._opened()
        if arm.sent_ns:  # it is this program's already
            return
        assert self._link is not None
        can = self._context.settings["can"]
        try:
            bus = f"{can['interface']}:{can['channel']}"
            check_alone(self._link, self._clock, bus)
            check_inactive(arm)
        except TractionError:
            self._release()
            raise

    def grants(self) -> list[Grant]:
        """Return what the kernel granted."""
        return self._grants

    def open_sensor(self) -> dict[str, str]:
        """Open a wrist sensor on the arm's bus; return its description."""
        arm = self._opened()
        assert self._link is not None
        self._sensor = open_bus_sensor(arm, self._link, self._clock)
        return self._sensor.describe()

    def _opened(self) -> WamArm:
        """Return the arm, its bus open; raises LinkError."""
        if self._arm is None:
            can = self._context.settings["can"]
            address = can["interface"], can["channel"], can["bitrate"]
            transport = open_transport(*address, self._clock)
            link = self._link = build_link(transport, self._context.shared, self._clock)
            properties = self._context.settings["properties"]
            noted = self._context.settings["lost_positions"]
            self._arm = build_arm(
                self._rig,
                self._constants,
                link,
                self._clock,
                properties,
                Path(noted) if noted else None,
            )
        return self._arm

    def begin(self) -> None:
        """Run the loop once this call is answered."""
        arm = self._opened()
        parts = LoopConfig(
            rig=self._rig,
            row=self._row,
            law=self._law,
            arm=arm,
            sensor=self._sensor,
            shared=self._context.shared,
            clock=self._clock,
            is_simulated=self._is_simulated,
            sound=self._sound,
        )
        self._loop_server = build_loop_server(parts)

    def _run(self, loop_server: LoopServer) -> None:
        """Run the loop; whatever ends it, an arm that got torques is idled."""
        loop = Loop(loop_server, self._clock, stats=loop_server.stats)
        try:
            while not loop_server.is_over:
                if self._is_orphaned:
                    loop_server.orphan()
                loop.step()
        finally:
            arm = self._opened()
            if arm.sent_ns:  # any other arm is left as it is
                arm.idle()
            loop_server.leave()

    def _release(self) -> None:
        """Idle the arm if it got torques from here, and give the bus back."""
        if self._arm is not None and self._link is not None:
            release(self._arm, self._link)
        self._arm = self._link = None

    def _sound(self) -> None:
        """Sound the bell of the console's terminal, if it has one."""
        path = self._context.settings.get("terminal")
        if not path:
            return
        with contextlib.suppress(OSError):
            terminal = os.open(path, os.O_WRONLY | os.O_NOCTTY | os.O_NONBLOCK)
            os.write(terminal, b"\a")
            os.close(terminal)

    def _note_orphaned(self, *_: object) -> None:
        self._is_orphaned = True


def reader(context: ChildContext) -> None:
    """Read a serial wrist sensor and put every sample into the shared memory."""
    name_process("traction-reader")
    SensorWorker(context).serve()


class SensorWorker:
    """The process that reads the sensor's port; implements `SensorService`."""

    def __init__(self, context: ChildContext) -> None:
        self._context = context
        self._clock = SystemClock()
        self._reconnecting = ReconnectingSensor(self._connect, self._clock)
        self._is_open = False
        self._grants = request(
            RealtimeRequest(READER_PRIORITY, context.settings.get("core"))
        )

    def serve(self) -> None:
        """Answer the console and read what comes until it hangs up."""
        channel = self._context.channel
        server = RpcServer(bind(SensorService, self))
        try:
            while True:
                if not self._is_open or channel.is_readable():
                    server.answer(channel)
                else:
                    self._read()
        except ChannelClosedError:
            self._reconnecting.close()

    def open_sensor(self) -> dict[str, str]:
        """Open the sensor; return its description."""
        fields = self._reconnecting.open()
        self._is_open = True
        return fields

    def _connect(self) -> SerialSensor:
        settings = self._context.settings
        rig = RigSettings.model_validate(settings["rig"])
        port = rig.ft_sensor.open_port(settings["port"]).port
        is_simulated = bool(settings["is_simulated"])
        return build_sensor(rig, port, self._clock, is_simulated=is_simulated)

    def sensor_metadata(self) -> dict[str, str]:
        """Return the statistics of the stream, as text."""
        return stream_metadata(self._reconnecting)

    def grants(self) -> list[Grant]:
        """Return what the kernel granted."""
        return self._grants

    def _read(self) -> None:
        """Publish what arrives within 20 ms; what is lost is looked for."""
        clock, shared = self._clock, self._context.shared
        deadline_ns = clock.now_ns() + READ_NS
        if self._reconnecting.sensor is None:
            clock.sleep_until(deadline_ns)
        else:
            # A port that has gone is readable, and says so when it is read.
            with contextlib.suppress(TractionError):
                clock.wait(self._reconnecting.sensor, deadline_ns)
        publish(self._reconnecting.poll(clock.now_ns()), shared.wrenches)
        shared.heartbeats.beat(ProcessRole.READER, clock.now_ns())
