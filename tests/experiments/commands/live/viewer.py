"""A viewer of Foxglove's WebSocket protocol, from its description, on a plain socket.

Text frames are JSON (serverInfo, advertise; subscribe back), binary ones begin with an
opcode: 1 = a message (subscription, ns, payload), 2 = time. RFC 6455 carries them.
"""

import base64
import json
import os
import socket
import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from types import TracebackType
from typing import Any, Self

SUBPROTOCOL = "foxglove.sdk.v1"
_TEXT, _BINARY, _CLOSE = 1, 2, 8
_MESSAGE, _TIME = 1, 2
_HEAD = struct.Struct("<BIQ")
_PATIENCE = 5.0  # s for an answer of the server


@dataclass
class Viewer:
    """Subscribes to every channel and records what it receives.

    Attributes:
        port: port of the server on this computer.
        info: serverInfo message.
        channels: advertised channels, by topic.
        messages: (ns, payload) by topic, in order.
        times: times sent by the server [ns].
        others: other binary messages.
    """

    port: int
    info: dict[str, Any] = field(default_factory=dict[str, Any])
    channels: dict[str, Any] = field(default_factory=dict[str, Any])
    messages: dict[str, list[tuple[int, bytes]]] = field(
        default_factory=dict[str, list[tuple[int, bytes]]]
    )
    times: list[int] = field(default_factory=list[int])
    others: list[bytes] = field(default_factory=list[bytes])

    def __post_init__(self) -> None:
        self._socket = socket.create_connection(("127.0.0.1", self.port), _PATIENCE)
        key = base64.b64encode(os.urandom(16)).decode()
        lines = (
            "GET / HTTP/1.1",
            f"Host: 127.0.0.1:{self.port}",
            "Upgrade: websocket",
            "Connection: Upgrade",
            f"Sec-WebSocket-Key: {key}",
            "Sec-WebSocket-Version: 13",
            f"Sec-WebSocket-Protocol: {SUBPROTOCOL}",
        )
        self._socket.sendall("\r\n".join([*lines, "", ""]).encode())
        self._data = b""
        while b"\r\n\r\n" not in self._data:
            self._more()
        head, _, self._data = self._data.partition(b"\r\n\r\n")
        if b" 101 " not in head.splitlines()[0]:
            raise ConnectionError(head.decode(errors="replace"))
        self._topics: dict[int, str] = {}

    def look(self, until: Callable[["Viewer"], object]) -> "Viewer":
        """Take frames until `until(self)` is true.

        Raises:
            ConnectionError: the server hung up.
        """
        while not until(self):
            kind, body = self._frame()
            if kind == _TEXT:
                self._hear(json.loads(body))
            elif kind == _BINARY:
                self._take(body)
            elif kind == _CLOSE:
                raise ConnectionError("closed")
        return self

    def ask(self, body: bytes) -> None:
        """Send a binary message."""
        self._send(_BINARY, body)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._socket.close()

    def _hear(self, message: dict[str, Any]) -> None:
        if message["op"] == "serverInfo":
            self.info = message
        elif message["op"] == "advertise":
            new = {channel["topic"]: channel for channel in message["channels"]}
            self.channels |= new
            wanted = [{"id": c["id"], "channelId": c["id"]} for c in new.values()]
            self._topics |= {c["id"]: topic for topic, c in new.items()}
            text = json.dumps({"op": "subscribe", "subscriptions": wanted})
            self._send(_TEXT, text.encode())

    def _take(self, body: bytes) -> None:
        if body[0] == _MESSAGE:
            _, subscription, t_ns = _HEAD.unpack_from(body)
            topic = self._topics[subscription]
            row = (t_ns, body[_HEAD.size :])
            self.messages.setdefault(topic, []).append(row)
        elif body[0] == _TIME:
            self.times.append(struct.unpack_from("<Q", body, 1)[0])
        else:
            self.others.append(body)

    def _frame(self) -> tuple[int, bytes]:
        first, second = self._bytes(2)
        length = second & 0x7F
        if length >= 126:
            size = 2 if length == 126 else 8
            length = int.from_bytes(self._bytes(size), "big")
        return first & 0x0F, self._bytes(length)

    def _send(self, kind: int, body: bytes) -> None:
        mask = os.urandom(4)
        size = len(body)
        head = bytes([0x80 | kind])
        if size < 126:
            head += bytes([0x80 | size])
        else:
            head += bytes([0xFE]) + size.to_bytes(2, "big")
        masked = bytes(byte ^ mask[i % 4] for i, byte in enumerate(body))
        self._socket.sendall(head + mask + masked)

    def _bytes(self, count: int) -> bytes:
        while len(self._data) < count:
            self._more()
        taken, self._data = self._data[:count], self._data[count:]
        return taken

    def _more(self) -> None:
        data = self._socket.recv(65536)
        if not data:
            raise ConnectionError("the server hung up")
        self._data += data
