"""Recorder in a separate process: its main loop, and its client in the console."""

import json
import signal
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from acquisition.clock import SystemClock
from acquisition.control_loop.realtime import RealtimeRequest, request
from acquisition.errors import TrialFileError
from acquisition.ipc.channel import ChannelClosedError
from acquisition.ipc.child import ANSWER_S, Child, ChildContext, name_process
from acquisition.ipc.heap import trim_heap
from acquisition.ipc.layout import SharedLayout
from acquisition.ipc.requests import Dispatcher, Handlers, Request
from acquisition.recording.recorder import Recorder, TrialRecording
from acquisition.trial_file.header import TrialHeader
from acquisition.trial_file.verify import VerifiedFile

DRAIN_S = 0.02
NICE = 5


@dataclass(frozen=True, slots=True)
class StartRecording(Request[None]):
    """See `TrialRecording.start`."""

    path: Path
    header: TrialHeader


@dataclass(frozen=True, slots=True)
class WriteEvent(Request[None]):
    """See `TrialRecording.event`."""

    level: int
    name: str
    text: str


@dataclass(frozen=True, slots=True)
class FinishRecording(Request[VerifiedFile]):
    """See `TrialRecording.finish`."""

    stop_reason: str


@dataclass(frozen=True, slots=True)
class AbandonRecording(Request[None]):
    """See `TrialRecording.abandon`."""


def recorder_handlers(recorder: TrialRecording) -> Handlers:
    """Return the handlers of requests to a recorder."""
    return {
        StartRecording: recorder.start,
        WriteEvent: recorder.event,
        FinishRecording: recorder.finish,
        AbandonRecording: recorder.abandon,
    }


def main(context: ChildContext) -> None:
    """Record from the shared memory until the console closes the channel.

    An open trial is then ended properly: nothing is lost with the console.
    """
    name_process("traction-record")
    # The open file has to be ended after the death of the console.
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    request(RealtimeRequest(nice=NICE, core=context.settings.get("core")))
    recorder = Recorder(context.shared, SystemClock())
    dispatcher = Dispatcher(recorder_handlers(recorder))
    try:
        while True:
            if context.channel.is_readable(DRAIN_S):
                was_recording = recorder.is_recording
                dispatcher.answer(context.channel)
                if was_recording and not recorder.is_recording:
                    trim_heap()
            recorder.drain()
            recorder.publish_state()
    except ChannelClosedError:
        recorder.drain()
        if recorder.is_recording:
            recorder.finish("console lost")


class RemoteRecorder:
    """A recorder in another process; implements `TrialRecording`.

    During a trial its status is read from shared memory, without blocking calls. A
    recorder that does not answer is killed and reported as lost.
    """

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
        self._child.ask(StartRecording(path.resolve(), header), ANSWER_S)
        self._is_recording = True

    def event(self, level: int, name: str, text: str) -> None:
        """Write an event with the present time, if a file is open."""
        self._child.ask(WriteEvent(level, name, text), ANSWER_S)

    def finish(self, stop_reason: str) -> VerifiedFile:
        """End, verify and publish the file."""
        self._is_recording = False
        return self._child.ask(FinishRecording(stop_reason), ANSWER_S)

    def abandon(self) -> None:
        """Stop recording; the data so far are kept as `.partial`."""
        if self._is_recording:
            self._is_recording = False
            if self._child.is_alive:
                self._child.ask(AbandonRecording(), ANSWER_S)

    @property
    def largest_backlog(self) -> int:
        """Largest number of unwritten cycles since the trial began."""
        return int(self._state().get("largest_backlog", 0))

    def check(self) -> None:
        """Raise the recorder's error during a trial.

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
