"""The multi-process backend of a rig."""

from dataclasses import dataclass
from typing import Any

from acquisition.clock import PERIOD_NS, Clock
from acquisition.control_loop.realtime import GrantResult, choose_cores
from acquisition.control_loop.states import ArmState
from acquisition.devices import SafetyMode
from acquisition.errors import LinkError, PreflightError, TractionError
from acquisition.ipc.child import ANSWER_S, Child, ProcessLostError
from acquisition.ipc.layout import SharedLayout
from acquisition.ipc.loop_client import LoopClient
from acquisition.ipc.requests import Answer, Request
from acquisition.ipc.shared_memory import require_ordered_stores
from acquisition.ipc.simulation import AskDevices
from acquisition.recording.recorder_process import RemoteRecorder
from experiments.rig.arm_lock import ArmLock
from experiments.rig.requests import (
    AskGrants,
    AskSafetyMode,
    AskStream,
    BeginLoop,
    ClaimArm,
    IdleArm,
    OpenSensor,
    StartArm,
)

_CONTROL, _READER = "control", "sensor reader"  # names of processes


@dataclass(frozen=True, slots=True)
class WorkerConfigs:
    """Configurations of the processes.

    Attributes:
        control: settings of the process that drives the arm.
        reader: settings of the process that reads the sensor's port; None = the sensor
            is on the arm's bus.
        fake: settings of the simulated rig; None = real devices.
    """

    control: dict[str, Any]
    reader: dict[str, Any] | None
    fake: dict[str, Any] | None


class MultiProcessBackend:
    """Separate processes for loop, recorder and serial sensor.

    Simulated devices run in a further process. All die with the console; the one with
    the arm idles it first.
    """

    def __init__(
        self,
        jobs: WorkerConfigs,
        shared: SharedLayout,
        clock: Clock,
        lock: ArmLock | None = None,
    ) -> None:
        """Start the processes; nothing is sent yet.

        Args:
            jobs: settings of each process.
            shared: the shared memory.
            clock: the console's clock.
            lock: lock of the arm, released by `close`; None = private bus.

        Raises:
            PreflightError: shared memory is not safe on this machine.
        """
        require_ordered_stores()
        self._shared = shared
        self._clock = clock
        self._lock = lock
        self._is_claimed = False
        self._children: dict[str, Child] = {}
        self._reported: set[str] = set()
        loop_core, other_core = choose_cores()
        self._jobs = jobs
        self.fake: Child | None = None
        if jobs.fake is not None:
            self.fake = self._spawn_fake(jobs.fake)
        jobs.control["core"] = loop_core
        self._control = self._spawn_control()
        recorder = self._spawn(
            "recorder",
            "acquisition.recording.recorder_process:main",
            {"core": other_core},
        )
        self._reader: Child | None = None
        if jobs.reader is not None:
            jobs.reader["core"] = other_core
            target = "experiments.rig.workers:reader"
            self._reader = self._spawn(_READER, target, jobs.reader)
        self.recorder = RemoteRecorder(recorder, shared)
        self.loop_client = LoopClient(shared, clock, self._advance)

    @property
    def recorder_pid(self) -> int:
        """Process id of the recorder."""
        return self._children["recorder"].pid

    def ask(self, request: Request[Answer]) -> Answer:
        """Send a request to the process that has the device; see `requests`."""
        kind = type(request)
        if kind is StartArm:
            self._claim()
        child = self._reader if kind is OpenSensor else None
        return (child or self._control).ask(request)

    def _claim(self) -> None:
        """Refuse another program's arm; nothing is ever sent to it then."""
        try:
            self._control.ask(ClaimArm())
        except (PreflightError, LinkError):
            self._is_claimed = False
            raise
        self._is_claimed = True

    def sensor_metadata(self) -> dict[str, str]:
        """Return counters of the sensor's stream since it was opened, as text.

        Empty for a sensor on the arm's bus, whose process is busy with the loop.
        """
        return {} if self._reader is None else self._reader.ask(AskStream(), ANSWER_S)

    def begin(self) -> None:
        """Start the loop."""
        self.loop_client.beat()
        self._control.ask(BeginLoop())

    def grants(self) -> dict[str, list[GrantResult]]:
        """Return the scheduling rights granted to each process."""
        grants: dict[str, list[GrantResult]] = {}
        if not self.loop_client.loop.is_running:
            grants[_CONTROL] = self._control.ask(AskGrants())
        if self._reader is not None:
            grants[_READER] = self._reader.ask(AskGrants())
        return grants

    @property
    def is_controlled(self) -> bool:
        """Whether the loop runs, and with it the control of the arm."""
        return self._control.is_alive and self.loop_client.loop.is_running

    @property
    def bus_path(self) -> str:
        """Path of the served bus of a simulated rig."""
        return str(self._jobs.control["can"]["channel"])

    def end_loop(self) -> None:
        """End the loop; the process with the arm answers requests again."""
        self.loop_client.leave()
        while self.loop_client.loop.is_running and self._control.is_alive:
            self._clock.sleep_until(self._clock.now_ns() + PERIOD_NS)

    def processes(self) -> dict[str, int]:
        """Return the process ids by name."""
        return {name: child.pid for name, child in self._children.items()}

    def idle(self) -> bool:
        """Idle the arm; if its process has died, a new one does it.

        An arm that was refused at its start is left unchanged.
        """
        if not self._is_claimed:
            return False
        if not self._control.is_alive:
            return self._rescue()
        if self.loop_client.loop.is_running:
            return self.loop_client.idle()
        return self._control.ask(IdleArm())

    def safety_mode(self) -> SafetyMode:
        """Return the latest mode of the safety module."""
        if self.loop_client.loop.is_running or not self._control.is_alive:
            return self.loop_client.status.safety
        return self._control.ask(AskSafetyMode())

    def close(self) -> None:
        """Idle the arm if torques were sent, and end all processes; safe to repeat."""
        if not self._children:
            return
        try:
            if self._may_hold():
                self.idle()
            if self._control.is_alive and self.loop_client.loop.is_running:
                self.loop_client.leave()
        except TractionError:
            pass  # without position requests the safety module idles the arm
        finally:
            for child in reversed(self._children.values()):
                child.stop()
            self._children.clear()
            self._shared.close()
            if self._lock is not None:
                self._lock.close()

    def _may_hold(self) -> bool:
        """Return whether the arm may still have torques."""
        if not self._is_claimed:
            return False
        loop_client = self.loop_client
        if not self._control.is_alive:
            return True
        is_idle = loop_client.status.state is ArmState.IDLE
        return loop_client.loop.is_running and not is_idle

    def _spawn_fake(self, settings: dict[str, Any]) -> Child:
        """Start the simulated rig and pass its addresses to the other processes."""
        child = self._spawn("fake rig", "fakes.serving.rig_process:main", settings)
        served = child.ask(AskDevices())
        self._jobs.control["can"] = {
            "interface": served.interface,
            "channel": served.channel,
            "bitrate": served.bitrate,
        }
        if self._jobs.reader is not None:
            self._jobs.reader["port"] = served.port
        return child

    def _spawn_control(self) -> Child:
        target = "experiments.rig.workers:control"
        return self._spawn(_CONTROL, target, self._jobs.control)

    def _spawn(self, name: str, target: str, settings: dict[str, Any]) -> Child:
        child = Child(name, target, settings, self._shared)
        self._children[name] = child
        return child

    def _advance(self, cycles: int) -> None:
        """Advance time; raises once for every process that has died meanwhile."""
        self._clock.sleep_until(self._clock.now_ns() + cycles * PERIOD_NS)
        for name, child in self._children.items():
            if name not in self._reported and not child.is_alive:
                self._reported.add(name)
                raise ProcessLostError(name, child.exit_reason())
        self.recorder.check()

    def _rescue(self) -> bool:
        """Idle the arm of a dead process through a new one."""
        self._children.pop(_CONTROL).stop()
        self._control = self._spawn_control()
        try:
            return self._control.ask(IdleArm())
        except TractionError:
            return False
