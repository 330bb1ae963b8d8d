"""An in-process serial port: the driver's end of a simulated line."""

import io
from typing import Protocol

from acquisition.clock import Clock

_KERNEL_BUFFER = 4096  # input buffer of a terminal [bytes]


class ByteStream(Protocol):
    """A simulated device on a serial line."""

    def port_opened(self, t_ns: int) -> None:
        """Notify the device that its port was opened."""
        ...

    def receive(self, t_ns: int, data: bytes) -> None:
        """Handle bytes from the client."""
        ...

    def due(self, t_ns: int) -> list[tuple[int, bytes]]:
        """Return (time [ns], bytes) of all output sent by `t_ns`."""
        ...

    def next_event_ns(self) -> int | None:
        """Return when the next output will be sent [ns]; None = never."""
        ...


class FakeSerialPort:
    """Implements `ft_sensor.serial_line.link.SerialPort` over a simulated device.

    Opening discards earlier input, as a real port does; bytes that do not fit into the
    kernel's buffer are lost and counted.

    Attributes:
        overrun: bytes lost without a reader.
    """

    def __init__(self, stream: ByteStream, clock: Clock, line_xor: int = 0) -> None:
        """Open the port now; `line_xor` garbles each byte, like a wrong baud rate."""
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
        """Receive the bytes sent by `t_ns`."""
        for _, data in self._stream.due(t_ns):
            if not self._is_open:
                continue
            free_bytes = _KERNEL_BUFFER - len(self._buffer)
            self._buffer += self._garbled(data[:free_bytes])
            self.overrun += max(0, len(data) - free_bytes)

    def next_event_ns(self) -> int | None:
        """Return when the next bytes arrive [ns]; None = never."""
        return self._stream.next_event_ns()

    def unplug(self) -> None:
        """Unplug the cable: every use of the port fails from now on."""
        self._is_unplugged = True

    def plug_in(self) -> None:
        """Plug the cable in again; this port stays unusable, as a real one does."""

    @property
    def in_waiting(self) -> int:
        """Number of received bytes."""
        self._check_usable()
        self.advance(self._clock.now_ns())
        return len(self._buffer)

    def read(self, size: int = 1, /) -> bytes:
        """Return at most `size` received bytes."""
        self._check_usable()
        if len(self._buffer) < size:
            self.advance(self._clock.now_ns())
        data = bytes(self._buffer[:size])
        del self._buffer[:size]
        return data

    def write(self, data: bytes, /) -> int:
        """Send `data` to the device."""
        self._check_usable()
        self._stream.receive(self._clock.now_ns(), self._garbled(data))
        return len(data)

    def reset_input_buffer(self) -> None:
        """Discard the received bytes."""
        self._check_usable()
        self.advance(self._clock.now_ns())
        self._buffer.clear()

    def fileno(self) -> int:
        """Raise: there is no descriptor; the simulated clock polls the port instead.

        Raises:
            io.UnsupportedOperation: always.
        """
        raise io.UnsupportedOperation("a simulated port has no descriptor")

    def close(self) -> None:
        """Close the port; the device continues to send."""
        self._is_open = False
        self._buffer.clear()

    def _garbled(self, data: bytes) -> bytes:
        if not self._line_xor:
            return data
        return bytes(byte ^ self._line_xor for byte in data)

    def _check_usable(self) -> None:
        if self._is_unplugged or not self._is_open:
            raise OSError(5, "Input/output error")
