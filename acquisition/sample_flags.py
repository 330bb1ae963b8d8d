"""What is known of one cycle as bits of `acquisition.sample.Flag`.

Plain numbers: Python makes a new object of every `|` between members of a Flag.
"""

from acquisition.devices import Arm, ArmReading, SafetyMode, Vector, WrenchSample
from acquisition.sample import MOTOR_FRESH_SHIFT, Flag

TORQUE_CLIPPED = int(Flag.TORQUE_CLIPPED)
JOINT7_LOCKED = int(Flag.JOINT7_LOCKED)
CONTACT = int(Flag.CONTACT)
_ARM_FRESH = int(Flag.ARM_FRESH)
_FT_FRESH = int(Flag.FT_FRESH)
_FT_SATURATED = int(Flag.FT_SATURATED)
_SAFETY_WARNING = int(Flag.SAFETY_WARNING)
_SAFETY_FAULT = int(Flag.SAFETY_FAULT)
_DEADLINE_MISSED = int(Flag.DEADLINE_MISSED)
_ROUNDING = 0.05  # what is sent may differ from what was wanted by this [N m]


def of_reading(reading: ArmReading, *, is_late: bool) -> int:
    """Return which motors answered, and whether the cycle began in time."""
    flags = reading.fresh << MOTOR_FRESH_SHIFT
    if reading.is_complete:
        flags |= _ARM_FRESH
    if is_late:
        flags |= _DEADLINE_MISSED
    return flags


def of_safety(arm: Arm, mode: SafetyMode) -> int:
    """Return the `mode` of the safety circuit, and what it complains of."""
    flags = int(mode)
    if arm.safety_warnings():
        flags |= _SAFETY_WARNING
    if arm.safety_faults():
        flags |= _SAFETY_FAULT
    return flags


def of_wrench(wrench: WrenchSample | None, *, is_new: bool) -> int:
    """Return how good the force sample in use is."""
    flags = _FT_FRESH if is_new else 0
    if wrench is not None and wrench.saturated:
        flags |= _FT_SATURATED
    return flags


def is_clipped(sent: Vector, wanted: Vector) -> bool:
    """Return whether torques [N m], shapes (7,), were cut on their way out."""
    for a, b in zip(sent.tolist(), wanted.tolist(), strict=True):
        if not -_ROUNDING <= a - b <= _ROUNDING:
            return True
    return False
