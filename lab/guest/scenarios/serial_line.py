"""The wrist sensor over ftdi_sio: speed, latency, makes, rights, the plug pulled."""

import fcntl
import os
import struct
from dataclasses import dataclass
from pathlib import Path

from acquisition.errors import TractionError
from experiments.settings.load import load_settings
from experiments.settings.sensor import build_device
from ft_sensor.serial_line.link import SerialLink, open_port
from ft_sensor.serial_line.sensor import SerialSensor
from lab.guest.commands import CLOCK, ScenarioError, read_text, require, seconds, wait
from lab.guest.machine_room import MachineRoom, line_port
from lab.guest.monitor import ADAPTER, Monitor
from lab.guest.network import set_up_both
from lab.guest.scenarios.bus import Figures, figure

PORT = Path("/dev/ttyUSB0")
_LATENCY = Path("/sys/bus/usb-serial/devices/ttyUSB0/latency_timer")
_TIOCGSERIAL = 0x541E
_LOW_LATENCY = 0x2000  # ASYNC_LOW_LATENCY
_FLAGS_AT = 16  # of struct serial_struct
_NOBODY = 65534
_WITHOUT_RIGHTS = ("setpriv", "--bounding-set", "-dac_override,-dac_read_search")
_NEW, _OLD_KIND = 'kind = "{}"', 'kind = "bota"'
_PATIENCE = 60.0
_MOST = 10.0  # s of guest time until an unplugged adapter is noticed


_OPTOFORCE = (
    "sensitivity = [18.28, 18.41, 2.12, 278.72, 259.55, 448.47]",
    'serial_number = "HEX00042"',
)


@dataclass(frozen=True, slots=True)
class Make:
    """A sensor as rig.toml names it; `extra`: lines that its section needs, too."""

    kind: str
    baudrate: int
    extra: tuple[str, ...] = ()
    dropped: tuple[str, ...] = ("sinc =",)


# At both speeds of the adapters in use, where their protocols know them; the Bota's
# ends at 460800, the OptoForce has one of its own.
MAKES = (
    Make("bota", 460_800, dropped=()),
    Make("robotous", 460_800, ("rate = 500",)),
    Make("robotous", 921_600),
    Make("optoforce", 460_800, _OPTOFORCE),
    Make("optoforce", 921_600, _OPTOFORCE),
    Make("optoforce", 1_000_000, _OPTOFORCE),
)


def three_makes(room: MachineRoom) -> Figures:
    """Read each make of sensor at its speeds and measure its rate."""
    figures: Figures = {}
    for make in MAKES:
        write_make(room, make)
        server = room.serve_far_sensor()
        try:
            figures[f"{make.kind} {make.baudrate}"] = _rate(room)
        finally:
            server.close()
    return figures


def low_latency(room: MachineRoom) -> Figures:
    """Ask the driver for low latency and read it back."""
    write_make(room, MAKES[0])
    _LATENCY.write_text("16", encoding="ascii")
    before = read_text(_LATENCY)
    opened = open_port(str(PORT), MAKES[0].baudrate)
    try:
        state = fcntl.ioctl(opened.port.fileno(), _TIOCGSERIAL, bytes(72))
        (flags,) = struct.unpack_from("<i", state, _FLAGS_AT)
    finally:
        opened.port.close()
    after = read_text(_LATENCY)
    require(bool(flags & _LOW_LATENCY), f"flags {flags:#x} without low latency")
    words = {"timer before": f"{before} ms", "after": f"{after} ms"}
    return {**words, "flags": f"{flags:#x}", "warning": opened.warning or "none"}


def no_rights(room: MachineRoom) -> Figures:
    """Open the port as a user without rights: a message that says what to do."""
    write_make(room, MAKES[0])
    # A root without this right is a user; the interpreter may lie in root's folder.
    os.chown(PORT, _NOBODY, _NOBODY)
    PORT.chmod(0o660)
    set_up_both(room.shell)
    room.serve_pushed_arm()
    try:
        program = room.traction("check", before=_WITHOUT_RIGHTS)
        output = room.finish(program, _PATIENCE, 3)
    finally:
        os.chown(PORT, 0, 0)
    require("dialout" in output, "the group that may read it is not named")
    return {"said": figure(output, r"(Cannot open[^.]*)")}


def unplugged(room: MachineRoom) -> Figures:
    """Pull the adapter out while the sensor is read; put it in and read again."""
    write_make(room, MAKES[0])
    server = room.serve_far_sensor()
    monitor = Monitor(room)
    try:
        sensor = _opened(room)
        try:
            monitor.pull_out(ADAPTER, PORT)
            taken, error = _until_it_fails(sensor)
        finally:
            sensor.close()
        monitor.put_in(ADAPTER, PORT)
        require(server.is_running, "the sensor's server has ended")
        rate = _rate(room)
    finally:
        monitor.close()
    return {"noticed after": f"{taken * 1e3:.0f} ms", "said": error, "again": rate}


def check_with_serial_sensor(room: MachineRoom) -> Figures:
    """Check the whole rig with its sensor on the serial adapter."""
    write_make(room, MAKES[0])
    set_up_both(room.shell)
    room.serve_pushed_arm("--line", str(line_port()))
    page = room.finish(room.traction("check"), _PATIENCE)
    return {
        "samples": figure(page, r"F/T samples\s+(.*)"),
        "stream": figure(page, r"F/T stream\s+(.*)"),
        "missed": figure(page, r"missed (\d+/\d+)"),
    }


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


def _until_it_fails(sensor: SerialSensor) -> tuple[float, str]:
    """Return how long a sensor went on without a cable [s], and what it says then."""
    start = seconds()
    while seconds() < start + _MOST:
        try:
            sensor.poll(CLOCK.now_ns())
        except TractionError as error:
            return seconds() - start, error.message
        wait(0.002)
    raise ScenarioError("a pulled cable is not noticed")
