"""What every serial wrist sensor tells, whatever its make: readings and their time."""

from dataclasses import dataclass
from itertools import repeat
from operator import mul

from acquisition.bounds import are_within

Wrench = tuple[float, float, float, float, float, float]

AXES = ("Fx", "Fy", "Fz", "Tx", "Ty", "Tz")
_BEYOND = 4.0  # times its range is more than any sensor shows
ALL_AXES = 0x3F  # one bit an axis, Fx the lowest


@dataclass(slots=True)
class Reading:
    """One frame of a sensor.

    Attributes:
        ticks: the device's clock or counter as received; 0 = it has none.
        wrench: fx fy fz tx ty tz in the sensor frame [N, N m].
        status: status bits as received.
        is_trusted: the device vouches for the numbers.
        saturated: bit i set = axis i is beyond its measuring range.
    """

    ticks: int
    wrench: Wrench
    status: int
    is_trusted: bool
    saturated: int


@dataclass(frozen=True, slots=True)
class StreamTiming:
    """How the frames of one stream follow each other.

    Attributes:
        period_ns: between two samples [ns].
        wire_ns: that one frame needs on the line [ns].
        modulus: where the device's clock or counter wraps; 0 = the device has none.
        tick_ns: one step of it [ns].
        frozen_ns: as long the six numbers cannot repeat in a sensor that measures [ns].
        frame_size: [bytes].
        stuck_ns: as long one of the numbers cannot repeat among others that change
            [ns]; 0 = its steps are so coarse that it may.
    """

    period_ns: float
    wire_ns: int
    modulus: int
    tick_ns: float
    frozen_ns: int
    frame_size: int
    stuck_ns: int = 0

    def unwrap(self, ticks: int, last: int) -> int:
        """Return the count nearest to `last` that the device shows as `ticks`."""
        half = self.modulus // 2
        return last + (ticks - last + half) % self.modulus - half


def axes_beyond(wrench: Wrench, ranges: Wrench) -> int:
    """Return the axes whose magnitude reaches its range, one bit each."""
    return sum(
        1 << axis
        for axis, (value, most) in enumerate(zip(wrench, ranges, strict=True))
        if abs(value) >= most
    )


def is_measurable(wrench: Wrench, ranges: Wrench) -> bool:
    """Return whether a sensor of these ranges can have measured the wrench.

    Beyond its range a sensor still shows something; a multiple of it, or no number at
    all, comes from a broken device or line, whatever the checksum says.
    """
    return are_within(wrench, map(mul, repeat(_BEYOND), ranges))


def axis_names(mask: int) -> tuple[str, ...]:
    """Return the names of the axes whose bits are set in `mask`."""
    return tuple(name for axis, name in enumerate(AXES) if mask >> axis & 1)


def largest_load(ranges: Wrench) -> tuple[float, float]:
    """Return force [N] and moment [N m] that are measured in whatever direction."""
    return min(ranges[:3]), min(ranges[3:])


def largest_traction(ranges: Wrench, lever: float) -> float:
    """Return the largest horizontal force at the sole that can be measured [N].

    The foot stands upright: the force acts `lever` [m] below the sensor's origin, in
    the plane of its x and y axes, in whatever direction suits the sensor least.
    """
    forces = min(ranges[0], ranges[1])
    return min(forces, min(ranges[3], ranges[4]) / lever) if lever > 0 else forces
