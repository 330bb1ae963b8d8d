"""A simulated serial device on a pseudo-terminal: another process opens its path."""

import contextlib
import os
import tty

from fakes.serial_port import ByteStream

_READ_AT_MOST = 4096


class SerialPty:
    """The device's end of a pseudo-terminal.

    Attributes:
        path: of the end that a driver opens, e.g. /dev/pts/3.
        overrun: bytes lost because nobody read.
    """

    def __init__(self, stream: ByteStream, t_ns: int) -> None:
        """Plug the device in at `t_ns`; it may be talking already."""
        self._device, self._line = os.openpty()
        tty.setraw(self._line)
        os.set_blocking(self._device, False)
        self.path = os.ttyname(self._line)
        self.overrun = 0
        self._stream = stream
        stream.port_opened(t_ns)

    def fileno(self) -> int:
        """Return the descriptor that is readable when the driver says something."""
        return self._device

    def advance(self, t_ns: int) -> None:
        """Carry bytes both ways up to `t_ns`."""
        with contextlib.suppress(BlockingIOError, OSError):
            self._stream.receive(t_ns, os.read(self._device, _READ_AT_MOST))
        for _, data in self._stream.due(t_ns):
            try:
                sent = os.write(self._device, data)
            except BlockingIOError:
                sent = 0
            self.overrun += len(data) - sent

    def next_event_ns(self) -> int | None:
        """Return when the next bytes leave the device; None = never."""
        return self._stream.next_event_ns()

    def close(self) -> None:
        """Unplug the device; a second call does nothing."""
        for descriptor in (self._device, self._line):
            with contextlib.suppress(OSError):
                os.close(descriptor)
        self._device = self._line = -1
