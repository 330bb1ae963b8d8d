"""Codec of property PEN: monitors of the safety module, lamps and buttons."""

from collections.abc import Collection
from dataclasses import dataclass
from enum import IntEnum

from acquisition.errors import DeviceFaultError


class SafetyLevel(IntEnum):
    """State of a monitor; UNKNOWN = no state bit or several are set."""

    UNKNOWN = 0
    SAFE = 1
    WARNING = 2
    FAULT = 4


class PendantButton(IntEnum):
    """Button pressed on the pendant."""

    E_STOP = 0
    ACTIVATE = 1
    IDLE = 2
    NONE = 3


@dataclass(frozen=True, slots=True)
class PendantState:
    """Decoded property PEN.

    Attributes:
        velocity, torque, voltage, heartbeat, other: state of each monitor.
        segments: lit segments of the display, bit 0 top, clockwise, bit 6 middle.
        is_idle_lit: the idle lamp is lit.
        is_active_lit: the activate lamp is lit.
        button: pressed button.
    """

    velocity: SafetyLevel
    torque: SafetyLevel
    voltage: SafetyLevel
    heartbeat: SafetyLevel
    other: SafetyLevel
    segments: int
    is_idle_lit: bool
    is_active_lit: bool
    button: PendantButton

    @property
    def faults(self) -> tuple[str, ...]:
        """Names of the monitors in fault."""
        return tuple(
            name for name in MONITORS if getattr(self, name) is SafetyLevel.FAULT
        )

    @property
    def inconsistent_monitors(self) -> tuple[str, ...]:
        """Names of the monitors in no state or several."""
        return tuple(
            name for name in MONITORS if getattr(self, name) is SafetyLevel.UNKNOWN
        )

    @property
    def warnings(self) -> tuple[str, ...]:
        """Names of the monitors in warning."""
        return tuple(
            name for name in MONITORS if getattr(self, name) is SafetyLevel.WARNING
        )


MONITORS = ("velocity", "torque", "voltage", "heartbeat", "other")


def decode_pendant(word: int, excused: Collection[str] = ()) -> PendantState:
    """Decode PEN, a 32-bit word (libbarrett, safety_module.cpp).

    Args:
        word: value reported by the module.
        excused: monitors for which an invalid state is UNKNOWN instead of an error.

    Raises:
        DeviceFaultError: another monitor is in no state or several.
    """
    levels = [_level(word, i, excused) for i in range(len(MONITORS))]
    return PendantState(
        *levels,
        segments=word >> 16 & 0xFF,
        is_idle_lit=bool(word >> 24 & 1),
        is_active_lit=bool(word >> 25 & 1),
        button=PendantButton(word >> 26 & 3),
    )


def encode_pendant(pendant: PendantState) -> int:
    """Encode PEN as the module reports it."""
    word = pendant.segments << 16 | pendant.button << 26
    word |= pendant.is_idle_lit << 24 | pendant.is_active_lit << 25
    for i, name in enumerate(MONITORS):
        word |= getattr(pendant, name) << 3 * i
    return word


NO_PENDANT = PendantState(
    *([SafetyLevel.UNKNOWN] * len(MONITORS)),
    segments=0,
    is_idle_lit=False,
    is_active_lit=False,
    button=PendantButton.NONE,
)


def _level(word: int, index: int, excused: Collection[str]) -> SafetyLevel:
    name, bits = MONITORS[index], word >> 3 * index & 7
    if bits in (1, 2, 4):
        return SafetyLevel(bits)
    if name in excused:
        return SafetyLevel.UNKNOWN
    raise DeviceFaultError(
        f"The pendant's {name} field is {bits:03b}; exactly one bit must be set "
        f"(word {word:08X}).",
        hint="Switch the arm off and on, then look at the pendant.",
    )
