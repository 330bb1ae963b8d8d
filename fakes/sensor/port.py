"""A serial port in process: the driver's end of a simulated wire."""

import io
from typing import Protocol

from acquisition.clock import Clock

_KERNEL_BUFFER = 4096  # what a terminal keeps for a reader that does not come


class ByteStream(Protocol):
    """A simulated device that talks over a serial line."""

    def port_opened(self, t_ns: int) -> None:
        """Somebody opened the port."""
        ...

    def receive(self, t_ns: int, data: bytes) -> None:
        """Take bytes from the client."""
        ...

    def due(self, t_ns: int) -> list[tuple[int, bytes]]:
        """Return all that has left the wire by `t_ns`."""
        ...

    def next_event_ns(self) -> int | None:
        """Return when the next bytes will have left the wire; None = never."""
        ...


class FakeSerialPort:
    """Implements `ft_sensor.serial_line.link.SerialPort` over a simulated device.

    Opening throws away what was sent before, as a real port does, and what does not
    fit into the kernel's buffer is lost and counted.

    Attributes:
        overrun: bytes lost without a reader.
    """

    def __init__(self, stream: ByteStream, clock: Clock, line_xor: int = 0) -> None:
        """Open the port now; `line_xor` garbles each byte, as a wrong speed does."""
        self.overrun = 0
        self._stream = stream
        self._clock = clock
        self._line_xor = line_xor
        self._buffer = bytearray()
        self._is_open = True
        self._is_unplugged = False
        stream.port_opened(clock.now_ns())
        self.reset_input_buffer()

    def advance(self, t_ns: int) -> None:
        """Let the bytes that have left the wire by `t_ns` arrive."""
        for _, data in self._stream.due(t_ns):
            if not self._is_open:
                continue
            room = _KERNEL_BUFFER - len(self._buffer)
            self._buffer += self._garbled(data[:room])
            self.overrun += max(0, len(data) - room)

    def next_event_ns(self) -> int | None:
        """Return when the next bytes arrive; None = never."""
        return self._stream.next_event_ns()

    def unplug(self) -> None:
        """Pull the cable: every use of the port fails from now on."""
        self._is_unplugged = True

    def plug_in(self) -> None:
        """Put it in again; a port that was open when it was pulled stays useless."""

    @property
    def in_waiting(self) -> int:
        """Number of bytes that have arrived by now."""
        self._require()
        self.advance(self._clock.now_ns())
        return len(self._buffer)

    def read(self, size: int = 1, /) -> bytes:
        """Return at most `size` of the bytes that have arrived."""
        self._require()
        if len(self._buffer) < size:
            self.advance(self._clock.now_ns())
        data = bytes(self._buffer[:size])
        del self._buffer[:size]
        return data

    def write(self, data: bytes, /) -> int:
        """Send `data` to the device."""
        self._require()
        self._stream.receive(self._clock.now_ns(), self._garbled(data))
        return len(data)

    def reset_input_buffer(self) -> None:
        """Throw away what has arrived by now."""
        self._require()
        self.advance(self._clock.now_ns())
        self._buffer.clear()

    def fileno(self) -> int:
        """Raise: there is no descriptor, the clock looks at the port instead.

        Raises:
            io.UnsupportedOperation: always.
        """
        raise io.UnsupportedOperation("a simulated port has no descriptor")

    def close(self) -> None:
        """Close the port; the device goes on sending."""
        self._is_open = False
        self._buffer.clear()

    def _garbled(self, data: bytes) -> bytes:
        if not self._line_xor:
            return data
        return bytes(byte ^ self._line_xor for byte in data)

    def _require(self) -> None:
        if self._is_unplugged or not self._is_open:
            raise OSError(5, "Input/output error")
