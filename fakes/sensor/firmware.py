"""The vendor-specific part of a wrist sensor: commands, frames, sample times."""

import math
from dataclasses import dataclass
from typing import Protocol

from ft_sensor.reading import Wrench

TimedBytes = tuple[int, bytes]  # time of sending [ns], bytes
FULL_SCALE = 32767  # 16-bit counts


@dataclass(frozen=True, slots=True)
class SampleSchedule:
    """Sample times of a running device by its own clock: first and period."""

    first_ns: int
    period_ns: float


@dataclass(slots=True)
class Measurement:
    """Readings of the gauges and the device's clock at one sample.

    Attributes:
        wrench: fx fy fz tx ty tz [N, N m], clipped at the ranges.
        saturated: bit i set = axis i was clipped.
        device_us: the device's clock [us], not wrapped.
        number: counter of frames since power-on.
        has_skipped: the previous sample could not be sent.
        temperature: temperature of the device [degrees Celsius].
    """

    wrench: Wrench
    saturated: int
    device_us: int
    number: int
    has_skipped: bool
    temperature: float


class Firmware(Protocol):
    """Commands and frames of one vendor.

    Attributes:
        drops_damaged_frames: the transport drops damaged frames (UDP checksum).
        baudrate: speed of the serial line [bit/s].
        schedule: sample times; None = not streaming. Assigning a new object restarts
            the stream.
        on_since_ns: time of power-on or of its last reset.
        clock_rate: rate of the device's clock, 1 = exact.
        frame_size: size of a frame [bytes].
    """

    drops_damaged_frames: bool
    baudrate: int
    schedule: SampleSchedule | None
    on_since_ns: int
    clock_rate: float
    frame_size: int

    def power_up(self, t_ns: int) -> list[TimedBytes]:
        """Restart; return the unsolicited output."""
        ...

    def receive(self, t_ns: int, data: bytes) -> list[TimedBytes]:
        """Handle bytes from the client; return the answers."""
        ...

    def frame(self, measurement: Measurement, status: int) -> bytes:
        """Return an encoded frame; `status` bits are added to the device's own."""
        ...


def count_of(value: float) -> int:
    """Return `value` as a 16-bit count; NaN and infinity read full scale."""
    if not math.isfinite(value):
        return FULL_SCALE
    return max(-FULL_SCALE, min(FULL_SCALE, round(value)))
