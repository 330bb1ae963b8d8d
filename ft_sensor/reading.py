"""Readings of a wrist sensor and timing of its stream, common to all makes."""

from dataclasses import dataclass
from itertools import repeat
from operator import mul

from acquisition.bounds import are_within

Wrench = tuple[float, float, float, float, float, float]

AXES = ("Fx", "Fy", "Fz", "Tx", "Ty", "Tz")
_BEYOND = 4.0  # multiple of the range that no sensor can measure
ALL_AXES = 0x3F  # one bit per axis, Fx the lowest


@dataclass(slots=True)
class Reading:
    """One frame of a sensor.

    Attributes:
        ticks: the device's clock or counter as received; 0 = it has none.
        wrench: fx fy fz tx ty tz in the sensor frame [N, N m].
        status: status bits as received.
        is_trusted: the device reports valid data.
        saturated: bit i set = axis i is beyond its measuring range.
    """

    ticks: int
    wrench: Wrench
    status: int
    is_trusted: bool
    saturated: int


@dataclass(frozen=True, slots=True)
class StreamTiming:
    """Timing of a sensor's stream.

    Attributes:
        period_ns: sample period [ns].
        wire_ns: transmission time of one frame [ns].
        modulus: modulus of the device's clock or counter; 0 = the device has none.
        tick_ns: one step of the clock or counter [ns].
        frozen_ns: a wrench that repeats for this time is frozen [ns].
        frame_size: [bytes].
        stuck_ns: an axis that repeats for this time while others change is stuck [ns];
            0 = not checked, the resolution is too coarse.
    """

    period_ns: float
    wire_ns: int
    modulus: int
    tick_ns: float
    frozen_ns: int
    frame_size: int
    stuck_ns: int = 0

    def unwrap(self, ticks: int, last: int) -> int:
        """Return the unwrapped count of `ticks` that is nearest to `last`."""
        half = self.modulus // 2
        return last + (ticks - last + half) % self.modulus - half


def axes_beyond(wrench: Wrench, ranges: Wrench) -> int:
    """Return the bits of the axes at or beyond their range."""
    return sum(
        1 << axis
        for axis, (value, limit) in enumerate(zip(wrench, ranges, strict=True))
        if abs(value) >= limit
    )


def is_measurable(wrench: Wrench, ranges: Wrench) -> bool:
    """Return whether a sensor with these ranges can have measured the wrench.

    A sensor still reads values somewhat beyond its range; NaN or a multiple of the
    range comes from a broken device or line, even with a correct checksum.
    """
    return are_within(wrench, map(mul, repeat(_BEYOND), ranges))


def axis_names(mask: int) -> tuple[str, ...]:
    """Return the names of the axes whose bits are set in `mask`."""
    return tuple(name for axis, name in enumerate(AXES) if mask >> axis & 1)


def largest_load(ranges: Wrench) -> tuple[float, float]:
    """Return force [N] and moment [N m] that can be measured in any direction."""
    return min(ranges[:3]), min(ranges[3:])


def largest_traction(ranges: Wrench, lever: float) -> float:
    """Return the largest horizontal force at the sole that can be measured [N].

    The foot is upright: the force acts `lever` [m] below the sensor's origin, parallel
    to its x-y plane, in the least favourable direction.
    """
    forces = min(ranges[0], ranges[1])
    return min(forces, min(ranges[3], ranges[4]) / lever) if lever > 0 else forces
