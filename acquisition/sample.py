"""Record of one cycle: flags, channels and storage layout."""

from dataclasses import dataclass
from enum import IntFlag
from itertools import repeat
from operator import sub

import numpy as np
from numpy.typing import NDArray

from acquisition.bounds import are_within
from acquisition.devices import Arm, ArmReading, SafetyMode, Vector, WrenchSample
from acquisition.schema import CYCLE

Record = NDArray[np.void]


class Flag(IntFlag):
    """Bits of `Cycle.flags` from 3 on; bits 0-2 hold the safety mode."""

    ARM_FRESH = 1 << 3
    FT_FRESH = 1 << 4
    FT_SATURATED = 1 << 5
    TORQUE_CLIPPED = 1 << 6
    # bit 7 is free
    SAFETY_WARNING = 1 << 8
    SAFETY_FAULT = 1 << 9
    DEADLINE_MISSED = 1 << 10
    JOINT7_LOCKED = 1 << 11
    CONTACT = 1 << 12
    SIMULATED = 1 << 13
    # 1 << 14 to 1 << 20: the reply of motor 1..7 is fresh
    BUS_ERROR = 1 << 21  # the CAN controller reported an error in this cycle
    # Cycle without a position request, on purpose: all positions are extrapolated.
    ARM_UNASKED = 1 << 22


SAFETY_MODE_MASK = 0b111
MOTOR_FRESH_SHIFT = 14  # bits 14-20: the reply of motor 1..7 is fresh


@dataclass(frozen=True, slots=True)
class ChannelMeaning:
    """Unit, frame and sign convention of a field of a recorded message."""

    field: str
    unit: str
    frame: str
    sign: str


CHANNELS = (
    ChannelMeaning(
        "cycle.host_ns", "ns", "host clock", "CLOCK_MONOTONIC at cycle start"
    ),
    ChannelMeaning(
        "cycle.arm_ns", "ns", "host clock", "last joint reply arrived, 0 = none"
    ),
    ChannelMeaning(
        "cycle.bus_ns",
        "ns",
        "host clock",
        "the bus had the last joint reply, 0 = not known",
    ),
    ChannelMeaning(
        "cycle.ft_ns", "ns", "host clock", "used F/T sample taken, 0 = none"
    ),
    ChannelMeaning("cycle.ft_counter", "us or count", "sensor clock", "as received"),
    ChannelMeaning("cycle.counts", "encoder counts", "motors 1..7", "as received"),
    ChannelMeaning(
        "cycle.position", "rad", "joints 1..7", "Denavit-Hartenberg, distal"
    ),
    ChannelMeaning(
        "cycle.velocity", "rad/s", "joints 1..7", "as the controller used it"
    ),
    ChannelMeaning("cycle.torque_command", "N m", "joints 1..7", "as sent"),
    ChannelMeaning(
        "cycle.torque_gravity", "N m", "joints 1..7", "gravity + effective mass"
    ),
    ChannelMeaning(
        "cycle.wrench", "N, N m", "ft_sensor", "force of the ground on the foot"
    ),
    ChannelMeaning(
        "cycle.wrench_raw", "N, N m", "ft_sensor", "as the sensor reads, untared"
    ),
    ChannelMeaning("cycle.foot_position", "m", "wam_base", "centre of the sole"),
    ChannelMeaning(
        "cycle.foot_orientation", "1", "wam_base", "quaternion x y z w of the foot"
    ),
    ChannelMeaning("cycle.foot_velocity", "m/s, rad/s", "wam_base", "linear, angular"),
    ChannelMeaning(
        "cycle.traction",
        "m/s, N, N",
        "terrain",
        "v_t > 0 in ordinary slip, F_t > 0 against it, F_n > 0 in compression",
    ),
)


class Sample:
    """Record of the loop, updated in place in every cycle.

    Every attribute is a numpy view of one payload of traction_msgs/Cycle: scalars have
    shape (1,), vectors their own length.
    """

    __slots__ = (
        "_bytes",
        "arm_ns",
        "bus_ns",
        "counts",
        "cycle",
        "data",
        "flags",
        "foot_orientation",
        "foot_position",
        "foot_velocity",
        "ft_counter",
        "ft_ns",
        "host_ns",
        "position",
        "torque_command",
        "torque_gravity",
        "traction",
        "velocity",
        "wrench",
        "wrench_raw",
    )

    cycle: NDArray[np.uint32]
    flags: NDArray[np.uint32]
    host_ns: NDArray[np.uint64]
    arm_ns: NDArray[np.uint64]
    bus_ns: NDArray[np.uint64]
    ft_ns: NDArray[np.uint64]
    ft_counter: NDArray[np.uint32]
    counts: NDArray[np.int32]
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    torque_command: NDArray[np.float64]
    torque_gravity: NDArray[np.float64]
    wrench: NDArray[np.float64]
    wrench_raw: NDArray[np.float64]
    foot_position: NDArray[np.float64]
    foot_orientation: NDArray[np.float64]
    foot_velocity: NDArray[np.float64]
    traction: NDArray[np.float64]

    def __init__(self) -> None:
        buffer = bytearray(CYCLE.template)
        self.data: Record = np.frombuffer(buffer, CYCLE.dtype)
        self._bytes = memoryview(buffer)
        for name in CYCLE.dtype.names or ():
            if name in self.__slots__:
                column = self.data[name]
                setattr(self, name, column[0] if column.ndim > 1 else column)
        for name in ("wrench", "wrench_raw", "traction"):
            getattr(self, name)[:] = np.nan

    def payload(self) -> memoryview:
        """Return the payload of the record, without a copy."""
        return self._bytes


# Plain integers: `|` of Flag members creates a new object each time.
_TORQUE_CLIPPED = int(Flag.TORQUE_CLIPPED)
_JOINT7_LOCKED = int(Flag.JOINT7_LOCKED)
_CONTACT = int(Flag.CONTACT)
_ARM_FRESH = int(Flag.ARM_FRESH)
_FT_FRESH = int(Flag.FT_FRESH)
_FT_SATURATED = int(Flag.FT_SATURATED)
_SAFETY_WARNING = int(Flag.SAFETY_WARNING)
_SAFETY_FAULT = int(Flag.SAFETY_FAULT)
_DEADLINE_MISSED = int(Flag.DEADLINE_MISSED)
_BUS_ERROR = int(Flag.BUS_ERROR)
_ARM_UNASKED = int(Flag.ARM_UNASKED)
_ROUNDING = 0.05  # difference of sent and desired torque by rounding [N m]


def reading_bits(reading: ArmReading, *, is_late: bool) -> int:
    """Return the flag bits of the joint reading and of a late cycle."""
    flags = reading.fresh << MOTOR_FRESH_SHIFT
    if reading.is_complete:
        flags |= _ARM_FRESH
    if is_late:
        flags |= _DEADLINE_MISSED
    if reading.has_bus_error:
        flags |= _BUS_ERROR
    if reading.is_without_request:
        flags |= _ARM_UNASKED
    return flags


def safety_bits(arm: Arm, mode: SafetyMode) -> int:
    """Return the flag bits of safety mode, warnings and faults."""
    flags = int(mode)
    if arm.safety_warnings():
        flags |= _SAFETY_WARNING
    if arm.safety_faults():
        flags |= _SAFETY_FAULT
    return flags


def wrench_bits(wrench: WrenchSample | None, *, is_new: bool) -> int:
    """Return the flag bits of the force sample in use."""
    flags = _FT_FRESH if is_new else 0
    if wrench is not None and wrench.saturated:
        flags |= _FT_SATURATED
    return flags


def control_bits(*, is_locked: bool, was_clipped: bool, has_contact: bool) -> int:
    """Return the flag bits of joint-7 lock, clipping and contact."""
    flags = _JOINT7_LOCKED if is_locked else 0
    if was_clipped:
        flags |= _TORQUE_CLIPPED
    if has_contact:
        flags |= _CONTACT
    return flags


def is_clipped(sent: Vector, wanted: Vector) -> bool:
    """Return whether torques [N m], shapes (7,), were clipped when sent."""
    differences = map(sub, sent.tolist(), wanted.tolist())
    return not are_within(differences, repeat(_ROUNDING))
