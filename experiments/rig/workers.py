"""Worker processes: one drives the arm, one reads the sensor."""

from __future__ import annotations

import contextlib
import os
import signal
from pathlib import Path

from acquisition.clock import SystemClock
from acquisition.control_loop.loop import Loop
from acquisition.control_loop.realtime import RealtimeRequest, request
from acquisition.devices import WrenchSensor
from acquisition.errors import TractionError
from acquisition.ipc.channel import ChannelClosedError
from acquisition.ipc.child import ChildContext, name_process
from acquisition.ipc.layout import ProcessRole
from acquisition.ipc.loop_server import LoopServer
from acquisition.ipc.requests import Dispatcher
from acquisition.ipc.shared_sensor import SharedSensor, publish
from experiments.rig.arm_service import ArmAccess, ArmService
from experiments.rig.build import (
    LoopConfig,
    build_arm,
    build_link,
    build_sensor,
    open_bus_sensor,
)
from experiments.rig.claim import check_alone, check_inactive
from experiments.rig.law_calibrations import LawCalibrations, build_law
from experiments.rig.requests import AskGrants, AskStream, OpenSensor
from experiments.settings.matrix import TerrainRow
from experiments.settings.rig import RigSettings
from ft_sensor.serial_line.reconnect import ReconnectingSensor, stream_metadata
from ft_sensor.serial_line.sensor import SerialSensor
from wam.bus.link import CanLink
from wam.bus.transports import open_transport
from wam.driver.arm import WamArm

CONTROL_PRIORITY = 80
READER_PRIORITY = 60
READ_NS = 20_000_000  # period of the reader's heartbeat


def control(context: ChildContext) -> None:
    """Drive the arm: answer the console, then run the loop until it ends."""
    name_process("traction-control")
    ControlWorker(context).serve()


class ControlWorker:
    """The process that drives the arm, one thread."""

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
        access = ArmAccess(
            open_bus=self._open_bus,
            check=self._check,
            open_sensor=lambda arm, link: open_bus_sensor(arm, link, self._clock),
            loop_config=self._loop_config,
            sensor=SharedSensor(context.shared.wrenches),
        )
        self._service = ArmService(access, self._clock)
        self._is_orphaned = False
        signal.signal(signal.SIGTERM, self._note_orphaned)
        core = settings.get("core")
        rights = RealtimeRequest(
            CONTROL_PRIORITY, core, lock_memory=True, limit_wakeup_latency=True
        )
        self._grants = request(rights)

    def serve(self) -> None:
        """Answer until the console hangs up; then idle an arm with torques."""
        service = self._service
        dispatcher = Dispatcher(service.handlers(), {AskGrants: lambda: self._grants})
        try:
            while not self._is_orphaned:
                dispatcher.answer(self._context.channel)
                if service.loop_server is not None:
                    self._run(service.loop_server)
                    service.loop_server = None
        except ChannelClosedError:
            pass
        finally:
            service.release()

    def _open_bus(self) -> tuple[WamArm, CanLink]:
        """Return the arm and its link, the bus open; raises LinkError."""
        settings = self._context.settings
        can = settings["can"]
        address = can["interface"], can["channel"], can["bitrate"]
        transport = open_transport(*address, self._clock)
        link = build_link(transport, self._context.shared, self._clock)
        noted = settings["lost_positions"]
        arm = build_arm(
            self._rig,
            self._law.model.constants,
            link,
            self._clock,
            settings["properties"],
            Path(noted) if noted else None,
        )
        return arm, link

    def _check(self, arm: WamArm, link: CanLink) -> None:
        """Refuse an arm used by another program; raises PreflightError, LinkError."""
        can = self._context.settings["can"]
        check_alone(link, self._clock, f"{can['interface']}:{can['channel']}")
        check_inactive(arm)

    def _loop_config(self, arm: WamArm, sensor: WrenchSensor) -> LoopConfig:
        return LoopConfig(
            rig=self._rig,
            row=self._row,
            law=self._law,
            arm=arm,
            sensor=sensor,
            shared=self._context.shared,
            clock=self._clock,
            is_simulated=self._is_simulated,
            sound=self._sound,
        )

    def _run(self, loop_server: LoopServer) -> None:
        """Run the loop; however it ends, an arm with torques is idled."""
        loop = Loop(loop_server, self._clock, stats=loop_server.stats)
        try:
            while not loop_server.is_over:
                if self._is_orphaned:
                    loop_server.on_console_death()
                loop.step()
        finally:
            arm = self._service.arm
            if arm.sent_ns:  # any other arm is left unchanged
                arm.idle()
            loop_server.leave()

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
    """Read a serial wrist sensor and publish its samples in the shared memory."""
    name_process("traction-reader")
    SensorWorker(context).serve()


class SensorWorker:
    """The process that reads the sensor's port."""

    def __init__(self, context: ChildContext) -> None:
        self._context = context
        self._clock = SystemClock()
        self._reconnecting = ReconnectingSensor(self._connect, self._clock)
        self._is_open = False
        self._grants = request(
            RealtimeRequest(READER_PRIORITY, context.settings.get("core"))
        )

    def serve(self) -> None:
        """Answer the console and read samples until it closes the channel."""
        channel = self._context.channel
        dispatcher = Dispatcher(
            {
                OpenSensor: self.open_sensor,
                AskStream: lambda: stream_metadata(self._reconnecting),
                AskGrants: lambda: self._grants,
            }
        )
        try:
            while True:
                if not self._is_open or channel.is_readable():
                    dispatcher.answer(channel)
                else:
                    self._read()
        except ChannelClosedError:
            self._reconnecting.close()

    def open_sensor(self) -> dict[str, str]:
        """Open the sensor; returns its description."""
        fields = self._reconnecting.open()
        self._is_open = True
        return fields

    def _connect(self) -> SerialSensor:
        settings = self._context.settings
        rig = RigSettings.model_validate(settings["rig"])
        port = rig.ft_sensor.open_port(settings["port"]).port
        is_simulated = bool(settings["is_simulated"])
        return build_sensor(rig, port, self._clock, is_simulated=is_simulated)

    def _read(self) -> None:
        """Publish the samples of 20 ms; reconnects a lost sensor."""
        clock, shared = self._clock, self._context.shared
        deadline_ns = clock.now_ns() + READ_NS
        if self._reconnecting.sensor is None:
            clock.sleep_until(deadline_ns)
        else:
            # A removed port is readable and fails when it is read.
            with contextlib.suppress(TractionError):
                clock.wait(self._reconnecting.sensor, deadline_ns)
        publish(self._reconnecting.poll(clock.now_ns()), shared.wrenches)
        shared.heartbeats.beat(ProcessRole.READER, clock.now_ns())
