"""A lossy network between a simulated sensor and its reader."""

import contextlib
import socket
from collections.abc import Sequence

import numpy as np

from fakes.sensor.port import ByteStream

_MAX_DATAGRAM = 2048
_LOOPBACK = "127.0.0.1"
Packets = list[tuple[int, bytes]]


class LossyNetwork:
    """A stream whose packets are lost, duplicated or reordered.

    Implements `fakes.sensor.port.ByteStream` around another one.
    """

    def __init__(
        self,
        stream: ByteStream,
        rng: np.random.Generator,
        lost: float = 0.0,
        doubled: float = 0.0,
        overtaken: float = 0.0,
    ) -> None:
        """Set the shares of affected packets; `rng` selects them."""
        self.counts = {"lost": 0, "doubled": 0, "overtaken": 0}
        self._stream = stream
        self._rng = rng
        self._shares = lost, doubled, overtaken
        self._held_back: bytes | None = None

    def port_opened(self, t_ns: int) -> None:
        """Notify the device that its port was opened."""
        self._stream.port_opened(t_ns)

    def receive(self, t_ns: int, data: bytes) -> None:
        """Pass a request to the device."""
        self._stream.receive(t_ns, data)

    def due(self, t_ns: int) -> Packets:
        """Return the packets that have arrived by `t_ns`."""
        out: Packets = []
        lost, doubled, overtaken = self._shares
        for at_ns, data in self._stream.due(t_ns):
            draw = self._rng.random()
            if draw < lost:
                self.counts["lost"] += 1
                continue
            if draw < lost + overtaken and self._held_back is None:
                self.counts["overtaken"] += 1
                self._held_back = data
                continue
            out.append((at_ns, data))
            if draw > 1.0 - doubled:
                self.counts["doubled"] += 1
                out.append((at_ns, data))
            if self._held_back is not None:
                out.append((at_ns, self._held_back))
                self._held_back = None
        return out

    def next_event_ns(self) -> int | None:
        """Return the time of the next possible packet [ns]; None = never."""
        return self._stream.next_event_ns()


class UdpDevice:
    """The device's end of a network, on loopback, for another process.

    It replaces `fakes.sensor.pty.SerialPty`.

    Attributes:
        path: its address, as a driver opens it.
        overrun: bytes lost without a reader.
    """

    def __init__(self, stream: ByteStream, t_ns: int, port: int = 0) -> None:
        """Plug the device in at `t_ns`; `port` 0 = any free port.

        Raises:
            OSError: the port is taken.
        """
        self.overrun = 0
        self._stream = stream
        self._socket: socket.socket | None = None
        self._reader: tuple[str, int] | None = None
        self._port = port
        self.plug_in(t_ns)
        self.path = f"{_LOOPBACK}:{self._port}"

    @property
    def is_plugged_in(self) -> bool:
        """Whether a device answers at the address."""
        return self._socket is not None

    def plug_in(self, t_ns: int) -> None:
        """Plug the cable in, if it is not."""
        if self._socket is not None:
            return
        udp_socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        udp_socket.setblocking(False)
        udp_socket.bind((_LOOPBACK, self._port))
        self._port = int(udp_socket.getsockname()[1])
        self._socket = udp_socket
        self._stream.due(t_ns)  # packets sent meanwhile are lost
        self._stream.port_opened(t_ns)

    def unplug(self) -> None:
        """Unplug the cable: nothing arrives any more."""
        self.close()

    def fileno(self) -> int:
        """Return the descriptor that is readable when a request has arrived."""
        return -1 if self._socket is None else self._socket.fileno()

    def advance(self, t_ns: int) -> None:
        """Transfer datagrams both ways up to `t_ns`."""
        self._receive_requests(t_ns)
        packets = self._stream.due(t_ns)
        self.send([data for _, data in packets])

    def send(self, packets: Sequence[bytes]) -> None:
        """Send datagrams to the sender of the last request, if any."""
        if self._socket is None or self._reader is None:
            return
        for data in packets:
            try:
                self._socket.sendto(data, self._reader)
            except OSError:  # full, or the reader has gone
                self.overrun += len(data)

    def next_event_ns(self) -> int | None:
        """Return when the next datagram leaves the device [ns]; None = never."""
        return self._stream.next_event_ns()

    def close(self) -> None:
        """Unplug the device; a second call does nothing."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _receive_requests(self, t_ns: int) -> None:
        if self._socket is None:
            return
        with contextlib.suppress(OSError):
            while True:
                data, sender = self._socket.recvfrom(_MAX_DATAGRAM)
                if sender[0] == _LOOPBACK:
                    self._reader = sender
                    self._stream.receive(t_ns, data)
