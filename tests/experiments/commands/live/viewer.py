"""Test client of Foxglove's WebSocket protocol, written from the specification.

Text frames are JSON (received: serverInfo, advertise; sent: subscribe), binary ones
begin with an opcode: 1 = message (subscription, ns, payload), 2 = time.
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
_MESSAGE_HEADER = struct.Struct("<BIQ")
_TIMEOUT = 5.0  # s


@dataclass
class Viewer:
    """Subscribes to every channel and records what it receives.

    Attributes:
        port: port of the server on this computer.
        info: serverInfo message.
        channels: advertised channels, by topic.
        messages: (ns, payload) by topic, in order.
        times: times sent by the server [ns].
        other_binary: binary messages of other opcodes.
    """

    port: int
    info: dict[str, Any] = field(default_factory=dict[str, Any])
    channels: dict[str, Any] = field(default_factory=dict[str, Any])
    messages: dict[str, list[tuple[int, bytes]]] = field(
        default_factory=dict[str, list[tuple[int, bytes]]]
    )
    times: list[int] = field(default_factory=list[int])
    other_binary: list[bytes] = field(default_factory=list[bytes])

    def __post_init__(self) -> None:
        self._socket = socket.create_connection(("127.0.0.1", self.port), _TIMEOUT)
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
        self._buffer = b""
        while b"\r\n\r\n" not in self._buffer:
            self._fill_buffer()
        head, _, self._buffer = self._buffer.partition(b"\r\n\r\n")
        if b" 101 " not in head.splitlines()[0]:
            raise ConnectionError(head.decode(errors="replace"))
        self._topics: dict[int, str] = {}

    def receive_until(self, condition: Callable[["Viewer"], object]) -> "Viewer":
        """Receive frames until `condition(self)` is true.

        Raises:
            ConnectionError: the server closed the connection.
        """
        while not condition(self):
            kind, body = self._read_frame()
            if kind == _TEXT:
                self._on_text(json.loads(body))
            elif kind == _BINARY:
                self._on_binary(body)
            elif kind == _CLOSE:
                raise ConnectionError("closed")
        return self

    def send_binary(self, body: bytes) -> None:
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

    def _on_text(self, message: dict[str, Any]) -> None:
        if message["op"] == "serverInfo":
            self.info = message
        elif message["op"] == "advertise":
            new = {channel["topic"]: channel for channel in message["channels"]}
            self.channels |= new
            wanted = [{"id": c["id"], "channelId": c["id"]} for c in new.values()]
            self._topics |= {c["id"]: topic for topic, c in new.items()}
            text = json.dumps({"op": "subscribe", "subscriptions": wanted})
            self._send(_TEXT, text.encode())

    def _on_binary(self, body: bytes) -> None:
        if body[0] == _MESSAGE:
            _, subscription, t_ns = _MESSAGE_HEADER.unpack_from(body)
            topic = self._topics[subscription]
            row = (t_ns, body[_MESSAGE_HEADER.size :])
            self.messages.setdefault(topic, []).append(row)
        elif body[0] == _TIME:
            self.times.append(struct.unpack_from("<Q", body, 1)[0])
        else:
            self.other_binary.append(body)

    def _read_frame(self) -> tuple[int, bytes]:
        first, second = self._read(2)
        length = second & 0x7F
        if length >= 126:
            size = 2 if length == 126 else 8
            length = int.from_bytes(self._read(size), "big")
        return first & 0x0F, self._read(length)

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

    def _read(self, count: int) -> bytes:
        while len(self._buffer) < count:
            self._fill_buffer()
        data, self._buffer = self._buffer[:count], self._buffer[count:]
        return data

    def _fill_buffer(self) -> None:
        data = self._socket.recv(65536)
        if not data:
            raise ConnectionError("the server closed the connection")
        self._buffer += data
