"""What is particular to a make of wrist sensor: its words, its frames, its pace."""

import math
from dataclasses import dataclass
from typing import Protocol

from ft_sensor.reading import Wrench

Saying = tuple[int, bytes]  # time of sending [ns], bytes
FULL_COUNT = 32767  # of a sensor that sends 16-bit counts


@dataclass(frozen=True, slots=True)
class SampleSchedule:
    """When a running device takes its samples, by its own clock: first and period."""

    first_ns: int
    period_ns: float


@dataclass(slots=True)
class Measurement:
    """What the gauges and the device's clock show at one sample.

    Attributes:
        wrench: fx fy fz tx ty tz [N, N m], clipped at the ranges.
        saturated: bit i set = axis i was clipped.
        device_us: the device's clock [us], not wrapped.
        number: frames sent since power-on, as a counter shows them.
        is_skipping: the sample before could not be sent.
        temperature: [degrees Celsius].
    """

    wrench: Wrench
    saturated: int
    device_us: int
    number: int
    is_skipping: bool
    temperature: float


class Firmware(Protocol):
    """What is particular to a make: its words and its frames.

    Attributes:
        baudrate: speed of its line [bit/s].
        schedule: when it samples; None = it does not stream. A new object is a new
            beginning.
        on_since_ns: when its power was switched on, or it reset itself.
        clock_rate: how fast its clock runs, 1 = right.
        frame_size: [bytes].
        is_checked: a frame that was damaged on its way does not arrive.
    """

    is_checked: bool
    baudrate: int
    schedule: SampleSchedule | None
    on_since_ns: int
    clock_rate: float
    frame_size: int

    def power_up(self, t_ns: int) -> list[Saying]:
        """Begin anew; return what it says by itself."""
        ...

    def receive(self, t_ns: int, data: bytes) -> list[Saying]:
        """Take bytes from the client; return the answers."""
        ...

    def frame(self, shown: Measurement, status: int) -> bytes:
        """Return the bytes of a frame with `status` bits set beside its own."""
        ...


def count_of(value: float) -> int:
    """Return `value` as a 16-bit count; what is no number reads full scale."""
    if not math.isfinite(value):
        return FULL_COUNT
    return max(-FULL_COUNT, min(FULL_COUNT, round(value)))
