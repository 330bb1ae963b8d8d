"""Serve a session recorded by another process to viewers, 50 times a second.

The ring buffers of the session are in anonymous shared memory. They are opened
read-only through the console's entry in /proc, without involving any process of the
session: this process can neither write nor delay it.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from acquisition.cdr import encode_log
from acquisition.clock import Clock, utc_offset_ns
from acquisition.control_loop.realtime import RealtimeRequest, choose_cores, request
from acquisition.errors import SessionError
from acquisition.ipc.layout import SharedLayout
from acquisition.settings import read_text
from experiments.commands.live.channels import (
    DESCRIPTION_TOPIC,
    EVENTS_TOPIC,
    LIVE_TOPICS,
    LiveEncoder,
)
from experiments.commands.live.server import HOST, LiveServer, layout_path
from experiments.operator.console import Console
from experiments.session.lock import owner_of
from experiments.session.store import SessionFolder, list_sessions
from wam.model.arm_model import urdf
from wam.model.constants import load_constants

PERIOD_NS = 20_000_000  # 50 Hz
NICE = 10
_LOOK_EVERY = 25  # periods between checks of the session's process
_EVENT_LEVEL, _EVENT_NAME = 20, "session"
# Fields of the journal that are not shown.
_HIDDEN = {"event", "utc", "fake", "config", "recording"}


class WatchedSession:
    """A session of another process, as messages."""

    def __init__(
        self, folder: SessionFolder, shared: SharedLayout, clock: Clock
    ) -> None:
        """Start with the latest sample.

        Args:
            folder: folder of the session.
            shared: its shared memory, read-only.
            clock: monotonic time and UTC of this computer.
        """
        self.folder = folder
        self._shared = shared
        self._offset_ns, _ = utc_offset_ns(clock)
        self._seen = shared.cycles.written
        self._journal = folder.path / "events.jsonl"
        self._size = -1
        self._sent = len(folder.events())
        config = folder.path / "config.toml"
        text = read_text(config) if config.exists() else ""
        self._encoder = LiveEncoder(urdf(load_constants()), text)

    def description(self) -> dict[str, bytes]:
        """Return the arm's URDF as a message, repeated for late viewers."""
        return {DESCRIPTION_TOPIC: self._encoder.description}

    def newest(self) -> tuple[dict[str, bytes], int] | None:
        """Return messages of the latest sample and its UTC [ns]; None if it is old."""
        if self._shared.cycles.written == self._seen:
            return None
        self._seen = self._shared.cycles.written
        records = self._shared.cycles.last(1)
        if not len(records):
            return None
        t_ns = int(records["host_ns"][0]) + self._offset_ns
        return self._encoder.messages(records[0], t_ns), t_ns

    def events(self, now_ns: int) -> list[tuple[dict[str, bytes], int]]:
        """Return the new entries of the journal, stamped with `now_ns` [UTC ns]."""
        size = self._journal.stat().st_size if self._journal.exists() else 0
        if size == self._size:
            return []
        self._size = size
        events = self.folder.events()
        new, self._sent = events[self._sent :], max(self._sent, len(events))
        return [
            (
                {EVENTS_TOPIC: encode_log(now_ns, _EVENT_LEVEL, _EVENT_NAME, text)},
                now_ns,
            )
            for text in map(event_text, new)
        ]

    def close(self) -> None:
        """Release the memory."""
        self._shared.close()


def event_text(event: Mapping[str, Any]) -> str:
    """Return an entry of the journal in one line."""
    details = " ".join(f"{k} {v}" for k, v in event.items() if k not in _HIDDEN)
    return f"{event.get('event')} {details}".strip()


def find_open(data: Path, name: str | None) -> tuple[SessionFolder, int] | None:
    """Return the latest session that a living process has open, with its pid.

    Args:
        data: the data folder.
        name: id or folder of the session; None = any.
    """
    if not (data / "sessions").is_dir():
        return None
    for folder in reversed(list_sessions(data)):
        if name is None or name in {folder.id, folder.path.name}:
            owner = owner_of(folder)
            if owner is not None and owner.pid:
                return folder, owner.pid
    return None


def watch(
    data: Path,
    name: str | None,
    port: int,
    console: Console,
    clock: Clock,
    is_over: Callable[[], bool],
) -> None:
    """Serve the sessions recorded below `data`, one after another, until `is_over`.

    Raises:
        MissingLibraryError: foxglove-sdk is not installed.
        SettingsError: the port is taken.
        SessionError: the session belongs to another user.
        LinkError: the session is recorded by another version of this program.
    """
    _, core = choose_cores()
    request(RealtimeRequest(nice=NICE, core=core))
    server = LiveServer(port, LIVE_TOPICS)
    try:
        console.say(f"Serving ws://{HOST}:{server.port} for this computer, read only.")
        console.say(f"Layout for the viewer: {layout_path()}")
        console.say(f"Waiting for a session in {data}. Ctrl-C ends this.")
        while not is_over():
            session = _open(data, name, clock)
            if session is not None:
                _serve(session, server, console, clock, is_over)
            else:
                clock.sleep_until(clock.now_ns() + _LOOK_EVERY * PERIOD_NS)
    finally:
        server.close()


def _open(data: Path, name: str | None, clock: Clock) -> WatchedSession | None:
    match = find_open(data, name)
    if match is None:
        return None
    folder, pid = match
    try:
        shared = SharedLayout.of_process(pid)
    except PermissionError as error:
        raise SessionError(
            f"{folder.id} is recorded by process {pid} of another user.",
            hint="Run traction watch as the user who records.",
        ) from error
    return None if shared is None else WatchedSession(folder, shared, clock)


def _serve(
    session: WatchedSession,
    server: LiveServer,
    console: Console,
    clock: Clock,
    is_over: Callable[[], bool],
) -> None:
    """Serve one session until its process ends."""
    console.say(f"{session.folder.id} {session.folder.terrain} is on the screen.")
    due_ns = clock.now_ns()
    period = 0
    try:
        while not is_over():
            newest = session.newest()
            if newest is not None:
                server.publish(*newest)
                server.send_time(newest[1])
            if period % _LOOK_EVERY == 0:
                now_ns = clock.utc_ns()
                server.publish(session.description(), now_ns)
                for event in session.events(now_ns):
                    server.publish(*event)
                if owner_of(session.folder) is None:
                    console.say(f"{session.folder.id} is not open any more.")
                    return
            period += 1
            due_ns = max(due_ns + PERIOD_NS, clock.now_ns())
            clock.sleep_until(due_ns)
    finally:
        session.close()
