"""Each wrist sensor on its simulated device, on a manually stepped clock."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from acquisition.devices import WrenchSample
from fakes.pucks.ft_puck import Load
from fakes.pucks.options import NetworkOptions
from fakes.sensor.ati import COUNTS, RANGES, AtiOptions, ati_stream
from fakes.sensor.bota import BotaOptions, bota_stream
from fakes.sensor.errors import SensorErrors
from fakes.sensor.optoforce import (
    SENSITIVITY,
    SERIAL_NUMBER,
    OptoForceOptions,
    optoforce_stream,
)
from fakes.sensor.port import FakeSerialPort
from fakes.sensor.robotous import RobotousOptions, robotous_stream
from fakes.sensor.stream import SensorStream
from ft_sensor.serial_line.link import PortSettings, SerialLink
from ft_sensor.serial_line.sensor import SerialDevice, SerialSensor
from ft_sensor.vendors.ati_device import AtiDevice, AtiSettings
from ft_sensor.vendors.barrett import BarrettSensor
from ft_sensor.vendors.bota_device import BotaDevice, BotaSettings
from ft_sensor.vendors.optoforce_device import OptoForceDevice, OptoForceSettings
from ft_sensor.vendors.robotous_device import RobotousDevice, RobotousSettings
from tests.fakes.stepped import Rig
from wam.bus.frames import SENSOR_NODE
from wam.driver.arm import WamArm

MS = 1_000_000
LOAD = (1.0, -2.0, 30.0, 0.1, 0.2, -0.3)


class SteppedTime:
    """A clock that jumps: to the next byte when waiting, to the end when sleeping."""

    def __init__(self) -> None:
        self.now = 10_000_000_000
        self.world: FakeSerialPort

    def now_ns(self) -> int:
        return self.now

    def utc_ns(self) -> int:
        return self.now

    def sleep_until(self, t_ns: int) -> None:
        self.now = max(self.now, t_ns)

    def wait(self, link, deadline_ns: int) -> bool:
        while not link.is_readable():
            event = self.world.next_event_ns()
            if event is None or event > deadline_ns:
                self.sleep_until(deadline_ns)
                return link.is_readable()
            self.sleep_until(event)
        return True


class ChunkedPort(FakeSerialPort):
    """Delivers what has arrived in pieces of one size."""

    chunk = 4096

    def read(self, size=1, /):
        return super().read(min(size, self.chunk))


@dataclass(frozen=True)
class Make:
    """One make of sensor: its device, its driver and its peculiarities."""

    stream: Callable[..., SensorStream]
    options: Callable[..., Any]
    device: Callable[[PortSettings], SerialDevice]
    baudrate: int
    rate: float
    resolution: tuple[float, ...]
    has_clock: bool
    quiet_start: dict[str, Any]
    running_start: dict[str, Any]
    drops_damaged_frames: bool = False  # the network drops damaged packets


MAKES = {
    "bota": Make(
        bota_stream,
        BotaOptions,
        lambda line: BotaDevice(line, BotaSettings()),
        460800,
        800.0,
        (1e-6,) * 6,
        True,
        {},
        {"is_running": True},
    ),
    "robotous": Make(
        robotous_stream,
        RobotousOptions,
        lambda line: RobotousDevice(line, RobotousSettings()),
        921600,
        1000.0,
        (0.02,) * 3 + (0.0005,) * 3,
        False,
        {},
        {"is_running": True},
    ),
    "optoforce": Make(
        optoforce_stream,
        OptoForceOptions,
        lambda line: OptoForceDevice(
            line, OptoForceSettings(SENSITIVITY, SERIAL_NUMBER)
        ),
        1_000_000,
        1000.0,
        tuple(1 / value for value in SENSITIVITY),
        True,
        {},
        {"is_running": True},
    ),
    "ati": Make(
        ati_stream,
        AtiOptions,
        lambda line: AtiDevice(line, AtiSettings(*COUNTS, RANGES)),
        100_000_000,
        1000.0,
        (1e-6,) * 6,
        True,
        {},
        {"is_running": True},
        drops_damaged_frames=True,
    ),
}


class SensorBench:
    """A sensor and its simulated device."""

    def __init__(
        self, kind, load=LOAD, line_xor=0, chunk=4096, network=None, **options
    ) -> None:
        """`network` wraps the stream of the device: losses on the way."""
        self.make = MAKES[kind]
        self.clock = SteppedTime()
        self.errors = SensorErrors(np.random.default_rng(1))
        self.device = self.make.stream(
            lambda t_ns: load,
            self.errors,
            self.make.options(**options),
            self.clock.now_ns(),
        )
        stream = network(self.device) if network else self.device
        self.port = ChunkedPort(stream, self.clock, line_xor)
        self.port.chunk = chunk
        self.clock.world = self.port
        self.driver = self.make.device(
            PortSettings("/dev/sensor", self.make.baudrate, 0.25)
        )
        self.sensor = SerialSensor(SerialLink(self.port), self.clock, self.driver)

    def opened(self) -> "SensorBench":
        self.sensor.open()
        return self

    def replug(self) -> None:
        """Open the port again with a new sensor, as after a crash."""
        self.port = ChunkedPort(self.device, self.clock)
        self.clock.world = self.port
        self.sensor = SerialSensor(SerialLink(self.port), self.clock, self.driver)

    def silence(self) -> None:
        self.device.go_silent()

    def run(self, duration_ns: int, period_ns: int = 2 * MS) -> list[WrenchSample]:
        """Poll every `period_ns`, and until nothing is left."""
        found: list[WrenchSample] = []
        for _ in range(duration_ns // period_ns):
            self.clock.sleep_until(self.clock.now_ns() + period_ns)
            while self.port.in_waiting:
                found += self.sensor.poll(self.clock.now_ns())
        return found


class BusBench:
    """The sensor on the arm's bus, polled with the positions of every cycle."""

    def __init__(self, load=LOAD) -> None:
        self.load = load
        self.rig = Rig(NetworkOptions(has_sensor=True), load=Load(lambda _: self.load))
        self.clock = self.rig.clock
        self.sensor = BarrettSensor(self.rig.link, self.clock)
        self.arm = WamArm(self.rig.link, self.clock)

    def opened(self) -> "BusBench":
        self.arm.start()
        self.sensor.open()
        self.arm.attach_device(self.sensor)
        return self

    def silence(self) -> None:
        self.rig.network.silence(SENSOR_NODE)

    def run(self, duration_ns: int, period_ns: int = 2 * MS) -> list[WrenchSample]:
        """Read, poll and send every `period_ns`."""
        found: list[WrenchSample] = []
        for _ in range(duration_ns // period_ns):
            reading = self.arm.read(self.clock.now_ns())
            found += self.sensor.poll(reading.host_ns)
            self.arm.send(np.zeros(7), np.zeros(7))
            self.clock.sleep_until(reading.host_ns + period_ns)
        return found
