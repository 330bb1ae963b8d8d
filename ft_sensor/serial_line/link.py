"""Non-blocking serial ports; the only importer of pyserial."""

import os
import termios
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import serial
from serial.tools import list_ports

from acquisition.clock import NS_PER_S
from acquisition.errors import LinkError, SettingsError
from ft_sensor.serial_line.framing import wire_time_ns


@dataclass(frozen=True, slots=True)
class PortSettings:
    """Settings of a serial line.

    Attributes:
        port: path of the serial device.
        baudrate: speed of the line [bit/s].
        rate_check: duration of the rate measurement after the start [s].
    """

    port: str
    baudrate: int
    rate_check: float = 2.0

    def require(self, baudrates: tuple[int, ...], size: int, period_ns: float) -> None:
        """Refuse a line that cannot carry the stream.

        Args:
            baudrates: speeds supported by the sensor [bit/s].
            size: frame size [bytes].
            period_ns: frame period [ns].

        Raises:
            SettingsError: unsupported speed, a line too slow for the frames, or a rate
                check that is too short or too long.
        """
        if self.baudrate not in baudrates:
            raise SettingsError(
                f"F/T sensor speed {self.baudrate} baud is unknown.",
                hint=f"Use one of {sorted(baudrates)}.",
            )
        if not 0.1 <= self.rate_check <= 60:
            raise SettingsError(
                f"F/T sensor rate check of {self.rate_check} s is out of range.",
                hint="0.1 to 60 s; 2 s are usual.",
            )
        wire_ns = wire_time_ns(size, self.baudrate)
        if wire_ns > period_ns:
            raise SettingsError(
                f"{self.baudrate} baud carries {NS_PER_S / wire_ns:.0f} F/T frames a "
                f"second, the sensor is to send {NS_PER_S / period_ns:.0f}.",
                hint="Raise the speed of the line or lower the rate.",
            )


_READ_LIMIT = 4096  # size of the kernel's tty buffer
_PORT_ERRORS = (OSError, termios.error)  # termios.error is not an OSError


class SerialPort(Protocol):
    """The part of pyserial's interface that is used here."""

    @property
    def in_waiting(self) -> int:
        """Number of bytes available."""
        ...

    def read(self, size: int = 1, /) -> bytes:
        """Return at most `size` bytes."""
        ...

    def write(self, data: bytes, /) -> int | None:
        """Send `data`."""
        ...

    def reset_input_buffer(self) -> None:
        """Discard received data."""
        ...

    def fileno(self) -> int:
        """Return the descriptor."""
        ...

    def close(self) -> None:
        """Close the device."""
        ...


@dataclass(frozen=True, slots=True)
class OpenedPort:
    """An open port and a warning about its settings, "" if there is none."""

    port: SerialPort
    warning: str


def open_port(path: str, baudrate: int) -> OpenedPort:
    """Open the serial device at `path`, 8N1, exclusively.

    Raises:
        LinkError: the device is missing, in use, or refuses the settings.
    """
    try:
        port = serial.Serial(
            path, baudrate, timeout=0, write_timeout=0.5, exclusive=True
        )
    except (*_PORT_ERRORS, ValueError) as error:
        raise LinkError(
            f"Cannot open the serial port {path} at {baudrate} baud: {error}.",
            hint="Is the sensor plugged in, the port its own, and no other program on "
            "it? Reading a port may need membership of the group dialout.",
        ) from error
    return OpenedPort(port, _low_latency_warning(port, path))


def _low_latency_warning(port: serial.Serial, path: str) -> str:
    try:
        port.set_low_latency_mode(True)
    except (*_PORT_ERRORS, ValueError, NotImplementedError):
        return f"{path} has no low-latency mode."
    return latency_timer_warning(path)


def latency_timer_warning(path: str, sysfs: Path = Path("/sys/class/tty")) -> str:
    """Return a warning if the latency timer of `path` is too long, else "".

    An FTDI adapter may accept the low-latency flag and still buffer for 16 ms, so the
    timer is read back.
    """
    timer = sysfs / Path(path).resolve().name / "device" / "latency_timer"
    try:
        value_ms = int(timer.read_text(encoding="ascii"))
    except (OSError, ValueError):
        return ""  # adapters of other makes have no such timer
    if value_ms <= 1:
        return ""
    return f"{path} delivers in bursts: latency timer {value_ms} ms, wanted 1 ms."


class SerialLink:
    """Serial port of the drivers; implements `acquisition.clock.Readable`."""

    def __init__(self, port: SerialPort) -> None:
        self._port = port
        self._is_open = True

    def read_available(self) -> bytes:
        """Return received data, at most 4096 bytes, without blocking.

        Raises:
            LinkError: the port is closed or gone.
        """
        self._require_open()
        try:
            count = self._port.in_waiting
            return self._port.read(min(count, _READ_LIMIT)) if count > 0 else b""
        except _PORT_ERRORS as error:
            raise _broken(error) from error

    def write(self, data: bytes) -> None:
        """Send `data`.

        Raises:
            LinkError: the port is closed or gone, or blocked for 0.5 s.
        """
        self._require_open()
        try:
            self._port.write(data)
        except _PORT_ERRORS as error:
            raise _broken(error) from error

    def discard_input(self) -> None:
        """Discard received data.

        Raises:
            LinkError: the port is closed or gone.
        """
        self._require_open()
        try:
            self._port.reset_input_buffer()
        except _PORT_ERRORS as error:
            raise _broken(error) from error

    def fileno(self) -> int:
        """Return the descriptor to wait on, -1 if the port has none."""
        try:
            return self._port.fileno()
        except _PORT_ERRORS:
            return -1

    def is_readable(self) -> bool:
        """Return whether bytes have arrived.

        Raises:
            LinkError: the port is closed or gone.
        """
        self._require_open()
        try:
            return self._port.in_waiting > 0
        except _PORT_ERRORS as error:
            raise _broken(error) from error

    def close(self) -> None:
        """Close the port; never raises, also on a second call."""
        if not self._is_open:
            return
        self._is_open = False
        try:
            self._port.close()
        except _PORT_ERRORS:
            return  # a device that is gone needs no closing

    def _require_open(self) -> None:
        if not self._is_open:
            raise LinkError("The serial port is closed.", hint="Open the sensor again.")


def _broken(error: Exception) -> LinkError:
    return LinkError(
        f"The serial port of the F/T sensor failed: {error}.",
        hint="Unplugged? Check the cable, then open the sensor again.",
    )


def adapter_serial(port: str) -> str | None:
    """Return the serial number of a port's USB adapter, or None."""
    real = os.path.realpath(port)
    serials = (p.serial_number for p in list_ports.comports() if p.device == real)
    return next((serial for serial in serials if serial), None)
