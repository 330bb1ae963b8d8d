"""The safety module: its mode, its fault word, and whether the arm was zeroed.

The host may only ask it to go down; up is the pendant's business.
"""

from dataclasses import dataclass
from enum import IntEnum

from acquisition import Clock, DeviceFaultError, LinkError, SafetyMode
from wam.bus import (
    SAFETY_NODE,
    Device,
    PropertyClient,
    nearest_documented,
    property_number,
)

COUNTS_PER_SPEED = 4096  # VL1 and VL2 are Q4.12: 1 m/s is 4096
WARNING_SHARE = 0.9  # of the fault's value, where no warning is given


@dataclass(frozen=True, slots=True)
class SafetyLimits:
    """Limits of the safety module; the defaults are its own after power-up.

    Attributes:
        speed_warning: of elbow and forearm [m/s].
        speed_fault: beyond it the module takes the arm to IDLE [m/s].
        torque_warning_units: largest commanded torque of any motor [puck units].
        torque_fault_units: beyond it the module takes the arm to IDLE [puck units].
    """

    speed_warning: float = 0.5
    speed_fault: float = 1.0
    torque_warning_units: int = 4731
    torque_fault_units: int = 5204

    def words(self) -> dict[str, int]:
        """Return the value of each property, floored as libbarrett does."""
        return {
            "VL1": int(self.speed_warning * COUNTS_PER_SPEED),
            "VL2": int(self.speed_fault * COUNTS_PER_SPEED),
            "TL1": self.torque_warning_units,
            "TL2": self.torque_fault_units,
        }


_MODE = 8  # the same in every firmware
_RETRY_NS = 10_000_000
_CONFIG_GAP_NS = 10_000_000  # configuration frames closer together are not promised


class SafetyLevel(IntEnum):
    """State of one of the module's monitors."""

    SAFE = 1
    WARNING = 2
    FAULT = 4


class PendantButton(IntEnum):
    """What is pressed on the pendant."""

    E_STOP = 0
    ACTIVATE = 1
    IDLE = 2
    NONE = 3


@dataclass(frozen=True, slots=True)
class PendantWord:
    """The word PEN taken apart.

    Attributes:
        velocity, torque, voltage, heartbeat, other: state of each monitor.
        segments: lit segments of the display, bit 0 top, clockwise, bit 6 middle.
        is_idle_lit: the idle lamp.
        is_active_lit: the activate lamp.
        button: what is pressed.
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
        """Names of the monitors that report a fault."""
        return tuple(
            name for name in MONITORS if getattr(self, name) is SafetyLevel.FAULT
        )

    @property
    def warnings(self) -> tuple[str, ...]:
        """Names of the monitors that warn."""
        return tuple(
            name for name in MONITORS if getattr(self, name) is SafetyLevel.WARNING
        )


MONITORS = ("velocity", "torque", "voltage", "heartbeat", "other")


def decode_pendant(word: int) -> PendantWord:
    """Return the meaning of PEN, a 32-bit word (libbarrett, safety_module.cpp).

    Raises:
        DeviceFaultError: a monitor shows none or several of its three states.
    """
    levels = [_level(word, 3 * i, name) for i, name in enumerate(MONITORS)]
    return PendantWord(
        *levels,
        segments=word >> 16 & 0xFF,
        is_idle_lit=bool(word >> 24 & 1),
        is_active_lit=bool(word >> 25 & 1),
        button=PendantButton(word >> 26 & 3),
    )


def encode_pendant(pendant: PendantWord) -> int:
    """Return the word PEN of a state, as the module reports it."""
    word = pendant.segments << 16 | pendant.button << 26
    word |= pendant.is_idle_lit << 24 | pendant.is_active_lit << 25
    for i, name in enumerate(MONITORS):
        word |= getattr(pendant, name) << 3 * i
    return word


def decode_mode(value: int) -> SafetyMode:
    """Return the mode a MODE reply stands for, UNKNOWN for anything else."""
    return SafetyMode(value) if value in (0, 1, 2) else SafetyMode.UNKNOWN


class SafetyModule:
    """Client of the safety module, for use outside the loop."""

    def __init__(self, properties: PropertyClient, clock: Clock, vers: int) -> None:
        self._properties = properties
        self._clock = clock
        self._vers = nearest_documented(vers)

    def mode(self) -> SafetyMode:
        """Return the mode.

        Raises:
            LinkTimeoutError: the module is silent.
            DeviceFaultError: it answered a mode that does not exist.
        """
        value = self._properties.require(SAFETY_NODE, _MODE, "MODE")
        mode = decode_mode(value)
        if mode is SafetyMode.UNKNOWN:
            raise DeviceFaultError(
                f"The safety module reports mode {value}; 0, 1 and 2 exist.",
                hint="Switch the arm off and on, then look at the pendant.",
            )
        return mode

    def lower_to_idle(self, within_ns: int) -> SafetyMode:
        """Ask for IDLE until the module confirms IDLE or E-STOP; return the last mode.

        UNKNOWN means that it never answered; ACTIVE that it did not obey. A bus that
        is down is tried again as well: its controller may come back.
        """
        deadline_ns = self._clock.now_ns() + within_ns
        mode = SafetyMode.UNKNOWN
        while self._clock.now_ns() < deadline_ns:
            value = self._ask_down()
            if value is not None:
                mode = decode_mode(value)
            if mode in (SafetyMode.IDLE, SafetyMode.E_STOP):
                break
            self._properties.pause(_RETRY_NS // 10)
        return mode

    def _ask_down(self) -> int | None:
        """Ask for IDLE once; return MODE as answered, None without an answer."""
        try:
            self._properties.set(SAFETY_NODE, _MODE, SafetyMode.IDLE)
            return self._properties.get(SAFETY_NODE, _MODE, _RETRY_NS)
        except LinkError:
            return None

    def is_zeroed(self) -> bool:
        """Return whether a host has defined the positions since power-up."""
        return self._get("ZERO") == 1

    def mark_zeroed(self) -> None:
        """Tell the module that positions are defined now.

        Raises:
            DeviceFaultError: the module does not confirm.
        """
        self._set("ZERO", 1)
        if not self.is_zeroed():
            raise DeviceFaultError(
                "The safety module does not accept ZERO = 1.",
                hint="Press Shift-idle and zero the arm again.",
            )

    def forget_zero(self) -> None:
        """Tell the module that positions have been lost."""
        self._set("ZERO", 0)

    def ignore_speed_faults(self, count: int) -> None:
        """Let the module ignore `count` samples before something makes a jump."""
        self._set("IFAULT", count)

    def set_limits(self, limits: SafetyLimits) -> None:
        """Bring VL and TL to their power-up values, then to `limits`, and read back.

        Raises:
            DeviceFaultError: the module keeps another value.
            LinkTimeoutError: the module is silent.
        """
        wanted = limits.words()
        for name in wanted:
            number = property_number(Device.SAFETY, name, self._vers)
            self._set("DEF", number)
            self._set("LOAD", number)
        for name, value in wanted.items():
            self._set(name, value)
        for name, value in wanted.items():
            actual = self._get(name)
            if actual != value:
                raise DeviceFaultError(
                    f"The safety module has {name} = {actual}, expected {value}.",
                    hint="Switch the arm off and on, then start again.",
                )

    def pendant(self) -> PendantWord:
        """Return pendant and monitors; DeviceFaultError if they make no sense."""
        return decode_pendant(self._get("PEN") & 0xFFFFFFFF)

    def _get(self, name: str) -> int:
        number = property_number(Device.SAFETY, name, self._vers)
        return self._properties.require(SAFETY_NODE, number, name)

    def _set(self, name: str, value: int) -> None:
        number = property_number(Device.SAFETY, name, self._vers)
        self._properties.set(SAFETY_NODE, number, value)
        self._properties.pause(_CONFIG_GAP_NS)


def _level(word: int, shift: int, name: str) -> SafetyLevel:
    bits = word >> shift & 7
    if bits not in (1, 2, 4):
        raise DeviceFaultError(
            f"The pendant's {name} field is {bits:03b}; exactly one bit must be set "
            f"(word {word:08X}).",
            hint="Switch the arm off and on, then look at the pendant.",
        )
    return SafetyLevel(bits)
