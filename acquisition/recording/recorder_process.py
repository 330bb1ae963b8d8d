"""The recorder as a process of its own: its main loop, and the console's view of it."""

import json
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from acquisition.clock import SystemClock
from acquisition.control_loop.realtime import RealtimeRequest, request
from acquisition.errors import TrialFileError
from acquisition.ipc.child import Child, ChildContext, name_process
from acquisition.ipc.layout import SharedLayout
from acquisition.ipc.rings import give_back_heap
from acquisition.ipc.rpc import ChannelClosedError, Handler
from acquisition.recording.recorder import Recorder
from acquisition.trial_file.verify import VerifiedFile
from acquisition.trial_file.writer import TrialHeader

DRAIN_S = 0.02
NICE = 5
_HEADER = TypeAdapter(TrialHeader)
_VERIFIED = TypeAdapter(VerifiedFile)


def main(station: ChildContext) -> None:
    """Record what the board shows until the console hangs up.

    A trial that is open then is ended properly: nothing is lost with the console.
    """
    name_process("traction-record")
    request(RealtimeRequest(nice=NICE, core=station.settings.get("core")))
    recorder = Recorder(station.shared, SystemClock())
    handlers: dict[str, Handler] = {
        "start": lambda told: recorder.start(
            Path(told["path"]), _HEADER.validate_python(told["header"])
        ),
        "event": lambda told: recorder.event(*told),
        "finish": lambda reason: _finish(recorder, reason),
        "abandon": lambda _: recorder.abandon(),
    }
    try:
        while True:
            if station.channel.is_readable(DRAIN_S):
                station.channel.answer(handlers)
            recorder.drain()
            recorder.publish_state()
    except ChannelClosedError:
        recorder.drain()
        if recorder.is_recording:
            recorder.finish("console lost")


def _finish(recorder: Recorder, reason: str) -> dict[str, Any]:
    verified = _VERIFIED.dump_python(recorder.finish(reason))
    give_back_heap()
    return verified


class RemoteRecorder:
    """A recorder in another process (implements TrialRecording)."""

    def __init__(self, child: Child, shared: SharedLayout) -> None:
        self._child = child
        self._shared = shared
        self._is_recording = False

    @property
    def is_recording(self) -> bool:
        """Whether a trial file is open."""
        return self._is_recording

    def start(self, path: Path, header: TrialHeader) -> None:
        """Begin a file with the last second of samples."""
        told = {"path": str(path.resolve())}
        told["header"] = _HEADER.dump_python(header, mode="json")
        self._child.ask("start", told)
        self._is_recording = True

    def event(self, level: int, name: str, text: str) -> None:
        """Write an event of now into the file, if one is open."""
        self._child.ask("event", [level, name, text])

    def finish(self, stop_reason: str) -> VerifiedFile:
        """End, verify and publish the file."""
        self._is_recording = False
        return _VERIFIED.validate_python(self._child.ask("finish", stop_reason))

    def abandon(self) -> None:
        """Stop recording; what there is goes to the disk and stays as `.partial`."""
        if self._is_recording:
            self._is_recording = False
            if self._child.is_alive:
                self._child.ask("abandon")

    @property
    def largest_backlog(self) -> int:
        """Cycles that waited at most since the trial began."""
        return int(self._state().get("largest_backlog", 0))

    def check(self) -> None:
        """Raise what went wrong while a trial is recorded.

        Raises:
            TrialFileError: the file cannot be written any more.
        """
        if not self._is_recording:
            return
        if failure := self._state().get("failure"):
            self._is_recording = False
            path, reason, hint = failure
            raise TrialFileError(Path(path), reason, hint=hint)

    def _state(self) -> dict[str, Any]:
        return json.loads(self._shared.recorder.read() or b"{}")
