"""CAN bus on a Unix socket, server end; clients receive each other's frames."""

import errno
import select
import socket
from pathlib import Path

from acquisition.clock import SystemClock
from acquisition.errors import LinkError, SettingsError
from fakes.bus.client import FRAME_SIZE, open_socket, pack_frame, unpack_frame
from wam.bus.transports import open_transport

CLIENTS = 32
_PACKETS_AT_A_TIME = 64  # packets read from one client in turn
_HIGHEST_ID, _LONGEST_DATA = 0x7FF, 8  # of a classic data frame
_LONGEST_PATH = 107  # bytes, the kernel's limit

Frame = tuple[int, bytes]


class SocketHub:
    """A listening socket and its clients; non-blocking.

    Attributes:
        ignored: packets other than classic data frames.
        lost: frames dropped because a client's buffer was full.
    """

    def __init__(self, path: Path) -> None:
        """Listen at `path`.

        Raises:
            SettingsError: the path is in use or not usable for a socket.
        """
        self.ignored = 0
        self.lost = 0
        self._path = path
        self._clients: dict[int, socket.socket] = {}
        self._dialog = _listen(path)
        self._inode = path.stat().st_ino
        self._poll = select.epoll()
        self._poll.register(self._dialog, select.EPOLLIN)

    @property
    def name(self) -> str:
        """Name of the bus for python-can."""
        return f"traction-fake:{self._path}"

    @property
    def clients(self) -> int:
        """Number of connected clients."""
        return len(self._clients)

    def fileno(self) -> int:
        """Return a descriptor that is readable when a client connects or sends."""
        return self._poll.fileno()

    def is_readable(self) -> bool:
        """Return whether a client connects or has sent something."""
        return bool(self._poll.poll(0))

    def receive(self) -> list[Frame]:
        """Return received frames of clients, after forwarding them to the others."""
        frames: list[Frame] = []
        for descriptor, _ in self._poll.poll(0):
            if descriptor == self._dialog.fileno():
                self._accept()
            elif descriptor in self._clients:
                frames += self._drain(descriptor)
        return frames

    def send(self, can_id: int, data: bytes) -> None:
        """Send a frame of the network to every client."""
        self._broadcast(pack_frame(can_id, data), sender=-1)

    def close(self) -> None:
        """Disconnect all clients and remove the socket; a second call does nothing."""
        if self._poll.closed:
            return
        for descriptor in list(self._clients):
            self._forget(descriptor)
        self._poll.close()
        self._dialog.close()
        if self._path.exists() and self._path.stat().st_ino == self._inode:
            self._path.unlink()

    def _accept(self) -> None:
        try:
            client, _ = self._dialog.accept()
        except OSError:
            return  # the client has disconnected again
        if len(self._clients) >= CLIENTS:
            client.close()
            return
        client.setblocking(False)
        self._clients[client.fileno()] = client
        self._poll.register(client, select.EPOLLIN)

    def _drain(self, descriptor: int) -> list[Frame]:
        frames: list[Frame] = []
        for _ in range(_PACKETS_AT_A_TIME):
            try:
                packet = self._clients[descriptor].recv(FRAME_SIZE + 1)
            except BlockingIOError:
                break
            except OSError:
                packet = b""
            if not packet:
                self._forget(descriptor)
                break
            if (frame := unpack_frame(packet)) is None:
                self.ignored += 1
            else:
                frames.append(frame)
                self._broadcast(packet, sender=descriptor)
        return frames

    def _broadcast(self, packet: bytes, sender: int) -> None:
        for descriptor, client in list(self._clients.items()):
            if descriptor == sender:
                continue
            try:
                client.send(packet)
            except BlockingIOError:
                self.lost += 1
            except OSError:
                self._forget(descriptor)

    def _forget(self, descriptor: int) -> None:
        if (client := self._clients.pop(descriptor, None)) is not None:
            self._poll.unregister(descriptor)
            client.close()


def _listen(path: Path) -> socket.socket:
    if len(bytes(path)) > _LONGEST_PATH:
        raise SettingsError(
            f"{path} has {len(bytes(path))} bytes, a socket's path {_LONGEST_PATH} at "
            "most.",
            hint="Choose a shorter one, e.g. traction-fake:/tmp/wam.sock.",
        )
    _remove_stale(path)
    dialog = open_socket()
    try:
        dialog.bind(str(path))
        path.chmod(0o600)  # only its owner may connect
        dialog.listen(CLIENTS)
        dialog.setblocking(False)
    except OSError as error:
        dialog.close()
        raise SettingsError(
            f"No bus can be served at {path}: {error.strerror or error}.",
            hint="Name a new file in an existing folder you may write to.",
        ) from error
    return dialog


def _remove_stale(path: Path) -> None:
    """Remove a socket left by a server; refuse any other file."""
    if not path.exists():
        return
    if not path.is_socket():
        raise SettingsError(
            f"{path} exists and is not a socket.",
            hint="Name a file that does not exist.",
        )
    with open_socket() as probe:
        probe.settimeout(1.0)
        if probe.connect_ex(str(path)) != errno.ECONNREFUSED:
            raise SettingsError(
                f"{path} is in use by another server.",
                hint="Stop that server, or choose another path.",
            )
    path.unlink()


class CanPort:
    """Port to a real CAN bus for a simulated network; non-blocking.

    Attributes:
        name: bus as INTERFACE:CHANNEL.
        ignored: received frames other than classic data frames.
        lost: frames refused by the bus.
    """

    def __init__(self, interface: str, channel: str, bitrate: int) -> None:
        """Open the bus; raises LinkError if that fails."""
        self.name = f"{interface}:{channel}"
        self.ignored = 0
        self.lost = 0
        self._transport = open_transport(interface, channel, bitrate, SystemClock())
        self._inbox: list[Frame] = []
        self._is_open = True
        self._descriptor = self._transport.fileno()

    def fileno(self) -> int:
        """Return the bus's descriptor, -1 if it has none."""
        return self._descriptor

    def is_readable(self) -> bool:
        """Return whether a frame has arrived."""
        if not self._inbox:
            self._drain()
        return bool(self._inbox)

    def receive(self) -> list[Frame]:
        """Return the received frames.

        Raises:
            LinkError: the bus is down.
        """
        self._drain()
        frames, self._inbox = self._inbox, []
        return frames

    def send(self, can_id: int, data: bytes) -> None:
        """Send a frame of the network."""
        try:
            self._transport.send(can_id, data)
        except LinkError:
            self.lost += 1  # as on a bus without acknowledgement

    def close(self) -> None:
        """Release the bus; a second call does nothing."""
        if self._is_open:
            self._is_open = False
            self._transport.close()

    def _drain(self) -> None:
        try:
            arrived = self._transport.receive()
        except LinkError as error:
            raise LinkError(
                f"CAN {self.name} failed: {error.message}",
                hint="Check it, then serve again.",
            ) from error
        for can_id, data, _ in arrived:
            # Other kinds of frames have flags in their identifier, or are longer.
            if can_id > _HIGHEST_ID or len(data) > _LONGEST_DATA:
                self.ignored += 1
            else:
                self._inbox.append((can_id, data))
