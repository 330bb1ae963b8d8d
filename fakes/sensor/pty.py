"""A simulated serial device on a pseudo-terminal, for another process."""

import contextlib
import os
import tty
from pathlib import Path

from fakes.sensor.port import ByteStream

_MAX_READ = 4096


class SerialPty:
    """The device's end of a pseudo-terminal.

    Attributes:
        path: path for the driver: `link`, or e.g. /dev/pts/3.
        overrun: bytes lost without a reader.
    """

    def __init__(self, stream: ByteStream, t_ns: int, link: Path | None = None) -> None:
        """Plug the device in at `t_ns`; it may be sending already.

        `link`: a path that persists when the device is unplugged and plugged in again.

        Raises:
            OSError: the name is taken.
        """
        self.overrun = 0
        self._stream = stream
        self._link = link
        self._device = self._line = -1
        self.plug_in(t_ns)
        self.path = str(link) if link is not None else os.ttyname(self._line)

    @property
    def is_plugged_in(self) -> bool:
        """Whether a device answers at the path."""
        return self._device >= 0

    def plug_in(self, t_ns: int) -> None:
        """Plug the cable in, if it is not."""
        if self.is_plugged_in:
            return
        self._device, self._line = os.openpty()
        tty.setraw(self._line)
        os.set_blocking(self._device, False)
        if self._link is not None:
            self._link.symlink_to(os.ttyname(self._line))
        self._stream.due(t_ns)  # bytes without a reader are lost
        self._stream.port_opened(t_ns)

    def unplug(self) -> None:
        """Unplug the cable: an open port disappears."""
        if self._link is not None and self.is_plugged_in:
            self._link.unlink(missing_ok=True)
        self.close()

    def fileno(self) -> int:
        """Return the descriptor that is readable when the driver has sent bytes."""
        return self._device

    def advance(self, t_ns: int) -> None:
        """Transfer bytes both ways up to `t_ns`."""
        with contextlib.suppress(BlockingIOError, OSError):
            self._stream.receive(t_ns, os.read(self._device, _MAX_READ))
        for _, data in self._stream.due(t_ns):
            try:
                sent = os.write(self._device, data)
            except OSError:  # full, or without a reader
                sent = 0
            self.overrun += len(data) - sent

    def next_event_ns(self) -> int | None:
        """Return when the next bytes leave the device [ns]; None = never."""
        return self._stream.next_event_ns()

    def close(self) -> None:
        """Unplug the device; a second call does nothing."""
        for descriptor in (self._device, self._line):
            with contextlib.suppress(OSError):
                os.close(descriptor)
        self._device = self._line = -1
