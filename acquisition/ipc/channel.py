"""A channel between two processes: whole JSON values over a socket pair."""

import json
import select
import socket
import struct
from typing import Any

_LENGTH = struct.Struct("<I")
LARGEST = 64 << 20  # bytes of one message


class ChannelClosedError(Exception):
    """The peer has closed the channel."""


class Channel:
    """One end of a socket pair that carries whole JSON values."""

    def __init__(self, end: socket.socket) -> None:
        self._socket = end

    @classmethod
    def pair(cls) -> tuple["Channel", "Channel"]:
        """Return two connected ends."""
        first, second = socket.socketpair(socket.AF_UNIX, socket.SOCK_STREAM)
        return cls(first), cls(second)

    @classmethod
    def adopt(cls, descriptor: int) -> "Channel":
        """Return the end inherited as `descriptor`."""
        return cls(socket.socket(fileno=descriptor))

    def fileno(self) -> int:
        """Return the descriptor to wait on."""
        return self._socket.fileno()

    def is_readable(self, seconds: float = 0.0) -> bool:
        """Wait up to `seconds` for data or end of file; return whether there is any."""
        return bool(select.select([self._socket], [], [], seconds)[0])

    def send(self, value: object) -> None:
        """Send one value.

        Raises:
            ChannelClosedError: the peer has closed the channel.
        """
        data = json.dumps(value).encode()
        try:
            self._socket.sendall(_LENGTH.pack(len(data)) + data)
        except OSError as error:
            raise ChannelClosedError from error

    def receive(self) -> Any:  # noqa: ANN401 - JSON has no narrower type
        """Wait for one value and return it.

        Raises:
            ChannelClosedError: the peer has closed the channel, or sent invalid data.
        """
        (length,) = _LENGTH.unpack(self._receive_exactly(_LENGTH.size))
        if length > LARGEST:
            raise ChannelClosedError
        try:
            return json.loads(self._receive_exactly(length))
        except ValueError as error:
            raise ChannelClosedError from error

    def close(self) -> None:
        """Close this end."""
        self._socket.close()

    def _receive_exactly(self, size: int) -> bytes:
        parts: list[bytes] = []
        while size:
            try:
                part = self._socket.recv(min(size, 1 << 20))
            except OSError as error:
                raise ChannelClosedError from error
            if not part:
                raise ChannelClosedError
            parts.append(part)
            size -= len(part)
        return b"".join(parts)
