"""Cost of one wrist-sensor frame, from bytes to a time-stamped sample.

    python -m benchmarks.parsing [--frames 20000]

Each sensor's stream is parsed in pieces of 3 ms, as in the running loop, and all at
once; time stamps come from the product's timestamper. The last column is the number of
such streams that one core keeps up with.
"""

import argparse
import math
import statistics

from acquisition.clock import SystemClock
from fakes.sensor.kinds import SERIAL_KINDS, SensorChoice, make_stream
from ft_sensor.serial_line.link import PortSettings
from ft_sensor.serial_line.sensor import SerialDevice
from ft_sensor.serial_line.timestamps import SampleTimestamper
from ft_sensor.vendors.ati_device import AtiDevice, AtiSettings
from ft_sensor.vendors.bota_device import BotaDevice, BotaSettings
from ft_sensor.vendors.optoforce_device import OptoForceDevice, OptoForceSettings
from ft_sensor.vendors.robotous_device import RobotousDevice, RobotousSettings

GOAL_US = 20.0
PIECE_NS = 3_000_000
ROUNDS = 9
CLOCK = SystemClock()
RANGES = (130.0, 130.0, 400.0, 10.0, 10.0, 10.0)
SENSITIVITY = (18.28, 18.41, 2.12, 278.72, 259.55, 448.47)


def devices() -> dict[str, SerialDevice]:
    """Return a driver of each sensor kind."""
    return {
        "bota": BotaDevice(PortSettings("none", 460800), BotaSettings()),
        "robotous": RobotousDevice(PortSettings("none", 921600), RobotousSettings()),
        "optoforce": OptoForceDevice(
            PortSettings("none", 1_000_000), OptoForceSettings(SENSITIVITY, "HEX00042")
        ),
        "ati": AtiDevice(
            PortSettings("none", 100_000_000), AtiSettings(1e6, 1e6, RANGES)
        ),
    }


def pieces(kind: str, frames: int, device: SerialDevice) -> list[tuple[int, bytes]]:
    """Return (arrival [ns], bytes) of a stream, in pieces of 3 ms."""

    def load(t_ns: int) -> tuple[float, ...]:
        return tuple(3.0 * math.sin(t_ns * 1e-8 + axis) for axis in range(6))

    stream = make_stream(SensorChoice(kind), load, None, 0)
    end_ns = round(frames * device.timing.period_ns)
    return [
        (t_ns, b"".join(data for _, data in stream.due(t_ns)))
        for t_ns in range(PIECE_NS, end_ns, PIECE_NS)
    ]


def cost_us(device: SerialDevice, stream: list[tuple[int, bytes]]) -> float:
    """Return the time per frame from bytes to a time-stamped sample [us]."""
    scanner, timestamper = device.scanner(), SampleTimestamper(device.timing)
    count = 0
    begun_ns = CLOCK.now_ns()
    for t_ns, data in stream:
        count += len(timestamper.date(scanner.feed(data), t_ns))
    return (CLOCK.now_ns() - begun_ns) / count / 1000


def scan_us(device: SerialDevice, stream: list[tuple[int, bytes]]) -> float:
    """Return the time per frame from bytes to numbers, all bytes at once [us]."""
    data = b"".join(data for _, data in stream)
    scanner = device.scanner()
    begun_ns = CLOCK.now_ns()
    count = len(scanner.feed(data))
    return (CLOCK.now_ns() - begun_ns) / count / 1000


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--frames", type=int, default=20_000)
    frames = parser.parse_args().frames
    print("sensor      scan us  with date us  goal us  x rate")
    for kind in SERIAL_KINDS:
        device = devices()[kind]
        stream = pieces(kind, frames, device)
        scan = statistics.median(scan_us(device, stream) for _ in range(ROUNDS))
        whole = statistics.median(cost_us(device, stream) for _ in range(ROUNDS))
        times = device.timing.period_ns / 1000 / whole
        print(f"{kind:10} {scan:8.2f} {whole:13.2f} {GOAL_US:8.0f} {times:7.0f}")


if __name__ == "__main__":
    main()
