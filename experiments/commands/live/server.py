"""Channels on a WebSocket of this computer; the only importer of foxglove-sdk."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

from acquisition.errors import SettingsError
from acquisition.extras import import_refusal
from acquisition.schema import schema_text

if TYPE_CHECKING:
    from foxglove import Channel, Context
    from foxglove.websocket import PlaybackControlRequest, ServerListener

HOST, PORT = "127.0.0.1", 8765
BACKLOG = 64  # queued messages per client; the oldest are dropped
LAYOUT_FILE = "foxglove_layout.json"


def layout_path() -> Path:
    """Return the file of the shipped layout."""
    return Path(str(resources.files("experiments.data") / LAYOUT_FILE))


@dataclass(frozen=True, slots=True)
class PlaybackRequest:
    """Request of a viewer to a playback.

    Attributes:
        is_playing: run or pause.
        speed: multiple of real time.
        seek_ns: position to seek first [UTC ns]; None = none.
        request_id: identifier for the reply.
    """

    is_playing: bool
    speed: float
    seek_ns: int | None
    request_id: str | None


def _listener(hear: Callable[[PlaybackRequest], None]) -> ServerListener:
    """Return the listener to viewers' requests, called on a thread of the library."""
    from foxglove.websocket import PlaybackCommand, ServerListener

    class Wishes(ServerListener):
        def on_playback_control_request(
            self, playback_control_request: PlaybackControlRequest
        ) -> None:
            asked = playback_control_request
            speed = asked.playback_speed
            hear(
                PlaybackRequest(
                    is_playing=asked.playback_command == PlaybackCommand.Play,
                    speed=speed if speed > 0.0 else 1.0,
                    seek_ns=asked.seek_time,
                    request_id=asked.request_id,
                )
            )

    return Wishes()


def _channels(topics: Mapping[str, str], context: Context) -> dict[str, Channel]:
    """Return a channel per topic, for CDR messages of a ROS 2 type."""
    from foxglove import Channel, Schema

    return {
        topic: Channel(
            topic,
            schema=Schema(
                name=type_name,
                encoding="ros2msg",
                data=schema_text(type_name).encode(),
            ),
            message_encoding="cdr",
            context=context,
        )
        for topic, type_name in topics.items()
    }


class LiveServer:
    """Serves channels on 127.0.0.1, read-only for clients.

    A client that does not read costs no more than its backlog: its oldest messages are
    dropped. The library starts threads: a process with a control loop must never create
    a server.

    Attributes:
        port: the port.
    """

    def __init__(
        self,
        port: int,
        topics: Mapping[str, str],
        *,
        span_ns: tuple[int, int] | None = None,
        hear: Callable[[PlaybackRequest], None] | None = None,
    ) -> None:
        """Start serving.

        Args:
            port: port; 0 = any free one.
            topics: message types by topic, CDR.
            span_ns: span of a playback that viewers may control [UTC ns]; None = live.
            hear: receives the viewers' requests, on another thread.

        Raises:
            MissingLibraryError: foxglove-sdk is not installed.
            SettingsError: the port is taken.
        """
        try:
            import foxglove
            from foxglove.websocket import Capability
        except ImportError as error:
            raise import_refusal(error, "foxglove", "live") from error
        foxglove.set_log_level("CRITICAL")  # suppress messages on closed clients
        self._context = context = foxglove.Context()  # its end closes the channels
        capabilities = [Capability.Time]
        if span_ns is not None:
            capabilities.append(Capability.PlaybackControl)
        self._channels = _channels(topics, context)
        try:
            self._server = foxglove.start_server(
                name="traction",
                host=HOST,
                port=port,
                capabilities=capabilities,
                server_listener=None if hear is None else _listener(hear),
                context=context,
                playback_time_range=span_ns,
                message_backlog_size=BACKLOG,
            )
        except (RuntimeError, OSError) as error:
            raise SettingsError(
                f"Port {port} of this computer cannot be served: {error}.",
                hint="Is another traction watch running? Name another --port.",
            ) from error
        self.port: int = self._server.port

    def publish(self, messages: Mapping[str, bytes], t_ns: int) -> None:
        """Send messages of UTC `t_ns` [ns], by topic, to all clients."""
        for topic, payload in messages.items():
            self._channels[topic].log(payload, log_time=t_ns)

    def send_time(self, t_ns: int) -> None:
        """Send the latest time [UTC ns], by which viewers show their lag."""
        self._server.broadcast_time(t_ns)

    def send_playback(self, wish: PlaybackRequest, t_ns: int, *, is_over: bool) -> None:
        """Send the state of a playback after `wish`, at UTC `t_ns` [ns]."""
        from foxglove.websocket import PlaybackState, PlaybackStatus

        status = PlaybackStatus.Playing if wish.is_playing else PlaybackStatus.Paused
        self._server.broadcast_playback_state(
            PlaybackState(
                status=PlaybackStatus.Ended if is_over else status,
                current_time=t_ns,
                playback_speed=wish.speed,
                did_seek=wish.seek_ns is not None,
                request_id=wish.request_id,
            )
        )

    def close(self) -> None:
        """Close all connections; safe to repeat."""
        self._server.stop()
