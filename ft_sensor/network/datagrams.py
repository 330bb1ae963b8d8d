"""UDP as a port: datagrams of one sensor, drained and never waited on.

The socket is connected: the kernel binds it to the one local address that leads to the
sensor and hands over nothing that comes from elsewhere. Datagrams of another size are
counted and dropped, so what is read is always a whole number of frames. The network
drops damaged ones itself, by their checksum; lost, doubled and overtaken ones are the
business of whoever reads their numbers.
"""

import ipaddress
import socket
from dataclasses import dataclass

from acquisition.errors import LinkError, SettingsError

_LARGEST = 2048  # bytes that are taken of one datagram
_HELD = 8192  # bytes that wait to be read
_MOST_AT_ONCE = 512  # datagrams in one look; the rest waits in the kernel
_HINT = "Is the sensor powered, its cable in, and this the address of its web page?"


@dataclass(frozen=True, slots=True)
class SensorAddress:
    """Where a sensor is: a number, never a name that would have to be looked up.

    Attributes:
        host: IPv4 address.
        port: of UDP.
    """

    host: str
    port: int

    @property
    def text(self) -> str:
        """As it is written in rig.toml."""
        return f"{self.host}:{self.port}"


def parse_address(text: str, usual_port: int) -> SensorAddress:
    """Return the address that `HOST` or `HOST:PORT` says.

    Raises:
        SettingsError: it is none, or one that no single sensor has.
    """
    host, mark, port = text.partition(":")
    try:
        address = ipaddress.IPv4Address(host)
        number = int(port) if mark else usual_port
    except ValueError:
        address, number = None, 0
    if address is None or not 0 < number < 65_536:
        raise SettingsError(
            f"{text[:60]!r} is no address of a sensor.",
            hint="Give its IPv4 address, e.g. 192.168.1.1.",
        )
    if address.is_multicast or address.is_unspecified or host == "255.255.255.255":
        raise SettingsError(
            f"{host} is the address of many, not of one sensor.",
            hint="Give its own, e.g. 192.168.1.1.",
        )
    return SensorAddress(host, number)


class DatagramPort:
    """Implements `ft_sensor.serial_line.link.SerialPort` over UDP.

    Attributes:
        strange: datagrams of another size than the sensor's.
        overrun: datagrams without a reader.
    """

    def __init__(self, address: SensorAddress, size: int) -> None:
        """Connect to `address`; its datagrams have `size` bytes.

        Raises:
            LinkError: no interface leads there.
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
                f"No way leads to the F/T sensor at {address.text}: {error}.",
                hint=_HINT,
            ) from error

    @property
    def in_waiting(self) -> int:
        """Number of bytes that can be read at once; whole datagrams."""
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
            LinkError: the network takes nothing.
        """
        try:
            return self._socket.send(data)
        except OSError as error:
            raise self._broken(error) from error

    def reset_input_buffer(self) -> None:
        """Throw away what has arrived."""
        self._receive()
        self._buffer.clear()

    def fileno(self) -> int:
        """Return the descriptor."""
        return self._socket.fileno()

    def close(self) -> None:
        """Give the socket back."""
        self._socket.close()

    def _receive(self) -> None:
        """Take what the kernel holds."""
        for _ in range(_MOST_AT_ONCE):
            try:
                data = self._socket.recv(_LARGEST)
            except BlockingIOError:
                return
            except OSError as error:
                raise self._broken(error) from error
            if len(data) != self._size:
                self.strange += 1
            elif len(self._buffer) + len(data) > _HELD:
                self.overrun += 1
            else:
                self._buffer += data

    def _broken(self, error: OSError) -> LinkError:
        return LinkError(
            f"The network to the F/T sensor at {self._address.text} failed: {error}.",
            hint=f"Unplugged? {_HINT}",
        )
