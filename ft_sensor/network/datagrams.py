"""Non-blocking UDP port for the datagrams of one sensor.

The socket is connected, so the kernel drops datagrams of other senders. Datagrams of
another size are counted and dropped: the data always consist of whole frames. The
network stack drops damaged ones by their checksum; lost, duplicate and reordered ones
are left to the protocol with its sequence numbers.
"""

import ipaddress
import socket
from dataclasses import dataclass

from acquisition.errors import LinkError, SettingsError

_DATAGRAM_BYTES = 2048  # bytes read of one datagram
_BUFFER_BYTES = 8192  # bytes buffered here
_DATAGRAMS_PER_CALL = 512  # datagrams per call; the rest stays in the kernel
_HINT = "Is the sensor powered, its cable in, and this the address of its web page?"


@dataclass(frozen=True, slots=True)
class SensorAddress:
    """Address of a sensor: numeric, without name resolution.

    Attributes:
        host: IPv4 address.
        port: UDP port.
    """

    host: str
    port: int

    @property
    def text(self) -> str:
        """The address as in rig.toml."""
        return f"{self.host}:{self.port}"


def parse_address(text: str, usual_port: int) -> SensorAddress:
    """Parse an address `HOST` or `HOST:PORT`.

    Raises:
        SettingsError: not a valid unicast address.
    """
    host, mark, port = text.partition(":")
    try:
        address = ipaddress.IPv4Address(host)
        number = int(port) if mark else usual_port
    except ValueError:
        address, number = None, 0
    if address is None or not 0 < number < 65_536:
        raise SettingsError(
            f"{text[:60]!r} is not an address of a sensor.",
            hint="Give its IPv4 address, e.g. 192.168.1.1.",
        )
    if address.is_multicast or address.is_unspecified or host == "255.255.255.255":
        raise SettingsError(
            f"{host} is not the address of a single sensor.",
            hint="Give its own, e.g. 192.168.1.1.",
        )
    return SensorAddress(host, number)


class DatagramPort:
    """Implements `ft_sensor.serial_line.link.SerialPort` over UDP.

    Attributes:
        strange: datagrams dropped because of their size.
        overrun: datagrams dropped because the buffer was full.
    """

    def __init__(self, address: SensorAddress, size: int) -> None:
        """Connect to `address`; its datagrams have `size` bytes.

        Raises:
            LinkError: no route to the address.
        """
        self.strange = 0
        self.overrun = 0
        self._address = address
        self._size = size
        self._buffer = bytearray()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        try:
            self._socket.connect((address.host, address.port))
        except OSError as error:
            self._socket.close()
            raise LinkError(
                f"No route to the F/T sensor at {address.text}: {error}.",
                hint=_HINT,
            ) from error

    @property
    def in_waiting(self) -> int:
        """Number of bytes available; whole datagrams."""
        self._receive()
        return len(self._buffer)

    def read(self, size: int = 1, /) -> bytes:
        """Return at most `size` bytes."""
        data = bytes(self._buffer[:size])
        del self._buffer[:size]
        return data

    def write(self, data: bytes, /) -> int:
        """Send one datagram.

        Raises:
            LinkError: the network refuses it.
        """
        try:
            return self._socket.send(data)
        except OSError as error:
            raise self._broken(error) from error

    def reset_input_buffer(self) -> None:
        """Discard received data."""
        self._receive()
        self._buffer.clear()

    def fileno(self) -> int:
        """Return the descriptor."""
        return self._socket.fileno()

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def _receive(self) -> None:
        """Read the kernel's queue into the buffer."""
        for _ in range(_DATAGRAMS_PER_CALL):
            try:
                data = self._socket.recv(_DATAGRAM_BYTES)
            except BlockingIOError:
                return
            except OSError as error:
                raise self._broken(error) from error
            if len(data) != self._size:
                self.strange += 1
            elif len(self._buffer) + len(data) > _BUFFER_BYTES:
                self.overrun += 1
            else:
                self._buffer += data

    def _broken(self, error: OSError) -> LinkError:
        return LinkError(
            f"The network to the F/T sensor at {self._address.text} failed: {error}.",
            hint=f"Unplugged? {_HINT}",
        )
