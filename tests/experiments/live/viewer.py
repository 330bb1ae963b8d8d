"""A viewer of Foxglove's WebSocket protocol, from its description, on a plain socket.

Text frames are JSON (serverInfo, advertise; subscribe back), binary ones begin with an
opcode: 1 = a message (subscription, ns, payload), 2 = time. RFC 6455 carries them.
"""

import base64
import json
import os
import socket
import struct
from dataclasses import dataclass, field

SUBPROTOCOL = "foxglove.sdk.v1"
_TEXT, _BINARY, _CLOSE = 1, 2, 8
_MESSAGE, _TIME = 1, 2
_HEAD = struct.Struct("<BIQ")


@dataclass
class Viewer:
    """Subscribes to every channel and keeps what it gets.

    Attributes:
        info: of the server.
        channels: as advertised, by topic.
        messages: (ns, payload) by topic, in order.
        times: what the server said of the time [ns].
        statuses: opcodes of other binary messages.
    """

    port: int
    info: dict = field(default_factory=dict)
    channels: dict = field(default_factory=dict)
    messages: dict = field(default_factory=dict)
    times: list = field(default_factory=list)
    others: list = field(default_factory=list)

    def __post_init__(self):
        self._socket = socket.create_connection(("127.0.0.1", self.port), 5.0)
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
        assert b" 101 " in head.splitlines()[0], head
        self._topics = {}

    def look(self, until):
        """Take frames until `until(self)` is true."""
        while not until(self):
            kind, body = self._frame()
            if kind == _TEXT:
                self._hear(json.loads(body))
            elif kind == _BINARY:
                self._take(body)
            elif kind == _CLOSE:
                raise ConnectionError("closed")
        return self

    def ask(self, body: bytes):
        """Send a binary message."""
        self._send(_BINARY, body)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._socket.close()

    def _hear(self, message):
        if message["op"] == "serverInfo":
            self.info = message
        elif message["op"] == "advertise":
            new = {channel["topic"]: channel for channel in message["channels"]}
            self.channels |= new
            wanted = [{"id": c["id"], "channelId": c["id"]} for c in new.values()]
            self._topics |= {c["id"]: topic for topic, c in new.items()}
            text = json.dumps({"op": "subscribe", "subscriptions": wanted})
            self._send(_TEXT, text.encode())

    def _take(self, body):
        if body[0] == _MESSAGE:
            _, subscription, t_ns = _HEAD.unpack_from(body)
            topic = self._topics[subscription]
            row = (t_ns, body[_HEAD.size :])
            self.messages.setdefault(topic, []).append(row)
        elif body[0] == _TIME:
            self.times.append(struct.unpack_from("<Q", body, 1)[0])
        else:
            self.others.append(body)

    def _frame(self):
        first, second = self._bytes(2)
        length = second & 0x7F
        if length >= 126:
            size = 2 if length == 126 else 8
            length = int.from_bytes(self._bytes(size), "big")
        return first & 0x0F, self._bytes(length)

    def _send(self, kind, body):
        mask = os.urandom(4)
        size = len(body)
        head = bytes([0x80 | kind])
        if size < 126:
            head += bytes([0x80 | size])
        else:
            head += bytes([0xFE]) + size.to_bytes(2, "big")
        masked = bytes(byte ^ mask[i % 4] for i, byte in enumerate(body))
        self._socket.sendall(head + mask + masked)

    def _bytes(self, count):
        while len(self._data) < count:
            self._more()
        taken, self._data = self._data[:count], self._data[count:]
        return taken

    def _more(self):
        data = self._socket.recv(65536)
        if not data:
            raise ConnectionError("the server hung up")
        self._data += data
