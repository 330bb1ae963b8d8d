"""The wrist sensor over ftdi_sio: sensor makes, baud rates and latency."""

import fcntl
import struct
from dataclasses import dataclass
from pathlib import Path

from acquisition.errors import TractionError
from experiments.settings.load import load_settings
from experiments.settings.sensor import build_device
from ft_sensor.serial_line.link import SerialLink, open_port
from ft_sensor.serial_line.sensor import SerialSensor
from lab.guest.commands import CLOCK, ScenarioError, read_text, require
from lab.guest.machine_room import MachineRoom, line_port
from lab.guest.network import set_up_both
from lab.guest.scenarios.bus import Figures, figure

PORT = Path("/dev/ttyUSB0")
_LATENCY = Path("/sys/bus/usb-serial/devices/ttyUSB0/latency_timer")
_TIOCGSERIAL = 0x541E
_LOW_LATENCY = 0x2000  # ASYNC_LOW_LATENCY
_FLAGS_AT = 16  # offset in struct serial_struct
_NEW, _OLD_KIND = 'kind = "{}"', 'kind = "bota"'
_PATIENCE = 60.0


_OPTOFORCE = (
    "sensitivity = [18.28, 18.41, 2.12, 278.72, 259.55, 448.47]",
    'serial_number = "HEX00042"',
)


@dataclass(frozen=True, slots=True)
class Make:
    """A sensor of rig.toml; `extra`: lines added to its section, `dropped`: removed."""

    kind: str
    baudrate: int
    extra: tuple[str, ...] = ()
    dropped: tuple[str, ...] = ("sinc =",)


# Both baud rates of common adapters where the sensor supports them: the Bota only
# supports up to 460800; the OptoForce has a third one.
MAKES = (
    Make("bota", 460_800, dropped=()),
    Make("robotous", 460_800, ("rate = 500",)),
    Make("robotous", 921_600),
    Make("optoforce", 460_800, _OPTOFORCE),
    Make("optoforce", 921_600, _OPTOFORCE),
    Make("optoforce", 1_000_000, _OPTOFORCE),
)


def serial_line(room: MachineRoom) -> Figures:
    """Set low latency, read each sensor at its baud rates, check the rig with one."""
    figures = _low_latency(room)
    for make in MAKES:
        write_make(room, make)
        server = room.serve_far_sensor()
        try:
            figures[f"{make.kind} {make.baudrate}"] = _rate(room)
        finally:
            server.close()
    write_make(room, MAKES[0])
    set_up_both(room.shell)
    room.serve_pushed_arm("--line", str(line_port()))
    page = room.finish(room.traction("check"), _PATIENCE)
    return {
        **figures,
        "samples": figure(page, r"F/T samples\s+(.*)"),
        "stream": figure(page, r"F/T stream\s+(.*)"),
    }


def _low_latency(room: MachineRoom) -> Figures:
    """Set low latency in the driver and read it back."""
    write_make(room, MAKES[0])
    _LATENCY.write_text("16", encoding="ascii")
    opened = open_port(str(PORT), MAKES[0].baudrate)
    try:
        state = fcntl.ioctl(opened.port.fileno(), _TIOCGSERIAL, bytes(72))
        (flags,) = struct.unpack_from("<i", state, _FLAGS_AT)
    finally:
        opened.port.close()
    require(bool(flags & _LOW_LATENCY), f"flags {flags:#x} without low latency")
    require(not opened.warning, f"warning: {opened.warning}")
    return {"latency timer": f"{read_text(_LATENCY)} ms"}


def write_make(room: MachineRoom, make: Make) -> None:
    """Write a configuration with a sensor of this make behind the adapter."""
    changes = {
        _OLD_KIND: _NEW.format(make.kind),
        "baudrate = 460800": "\n".join([f"baudrate = {make.baudrate}", *make.extra]),
    }
    room.write_config(changes, make.dropped)


def _opened(room: MachineRoom) -> SerialSensor:
    section = load_settings(room.config).rig.ft_sensor
    device = build_device(section)
    if device is None:
        raise ScenarioError("the sensor is not a serial one")
    opened = open_port(section.port, section.baudrate)
    sensor = SerialSensor(SerialLink(opened.port), CLOCK, device)
    try:
        sensor.open()
    except TractionError as error:
        sensor.close()
        raise ScenarioError(f"{section.kind}: {error.message}") from error
    return sensor


def _rate(room: MachineRoom) -> str:
    sensor = _opened(room)
    try:
        return sensor.describe()["measured_rate"]
    finally:
        sensor.close()
