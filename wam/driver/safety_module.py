"""Client of the safety module: mode, limits, monitors, and zeroed state of the arm.

The host can only lower the mode (IDLE, E-stop); only the pendant activates the arm.
"""

from collections.abc import Collection
from dataclasses import dataclass

from acquisition.clock import Clock
from acquisition.devices import SafetyMode
from acquisition.errors import DeviceFaultError, LinkError
from wam.bus.frames import MOTOR_NODES, SAFETY_NODE
from wam.bus.properties import (
    Device,
    PuckMode,
    nearest_documented,
    property_number,
)
from wam.bus.property_client import PropertyClient
from wam.driver.pendant import MONITORS, NO_PENDANT, PendantState, decode_pendant

COUNTS_PER_SPEED = 4096  # VL1 and VL2 are Q4.12: 1 m/s is 4096
WARNING_SHARE = 0.9  # of the fault limit: default of a warning limit


@dataclass(frozen=True, slots=True)
class SafetyLimits:
    """Limits of the safety module; the defaults are those after power-up.

    Attributes:
        speed_warning: speed of elbow and forearm with a warning [m/s].
        speed_fault: speed at which the module idles the arm [m/s].
        torque_warning_units: commanded motor torque with a warning [puck units].
        torque_fault_units: torque at which the module idles the arm [puck units].
    """

    speed_warning: float = 0.5
    speed_fault: float = 1.0
    torque_warning_units: int = 4731
    torque_fault_units: int = 5204

    def words(self) -> dict[str, int]:
        """Return the property values, rounded down as in libbarrett."""
        return {
            "VL1": int(self.speed_warning * COUNTS_PER_SPEED),
            "VL2": int(self.speed_fault * COUNTS_PER_SPEED),
            "TL1": self.torque_warning_units,
            "TL2": self.torque_fault_units,
        }


_MODE = 8  # the same in every firmware
_RETRY_NS = 10_000_000
_ANSWER_NS = 2_000_000  # reply time limit of a puck; 1 ms in the vendor's library
_CONFIG_GAP_NS = 10_000_000  # documented spacing of configuration frames


def decode_mode(value: int) -> SafetyMode:
    """Return the mode of a MODE reply, UNKNOWN for an invalid value."""
    return SafetyMode(value) if value in (0, 1, 2) else SafetyMode.UNKNOWN


class SafetyModule:
    """Client of the safety module, for use outside the loop.

    Attributes:
        defaults: power-up limits read by `set_limits`, in the order of
            `SafetyLimits.words`; None = no reply, () = not read.
    """

    def __init__(self, properties: PropertyClient, clock: Clock, vers: int) -> None:
        self.defaults: tuple[int | None, ...] = ()
        self._properties = properties
        self._clock = clock
        self._vers = nearest_documented(vers)

    def mode(self) -> SafetyMode:
        """Return the mode.

        Raises:
            LinkTimeoutError: the module is silent.
            DeviceFaultError: it reports an invalid mode.
        """
        value = self._properties.require(SAFETY_NODE, _MODE, "MODE")
        mode = decode_mode(value)
        if mode is SafetyMode.UNKNOWN:
            raise DeviceFaultError(
                f"The safety module reports mode {value}; 0, 1 and 2 exist.",
                hint="Switch the arm off and on, then look at the pendant.",
            )
        return mode

    def serial(self) -> int | None:
        """Return the serial number, None without a reply."""
        return self._try_get("SN")

    def lower_to_idle(self, within_ns: int) -> SafetyMode:
        """Command IDLE until the module confirms IDLE or E-STOP; return the last mode.

        UNKNOWN = it never answered; ACTIVE = it did not obey. A bus that is down is
        retried: its controller may restart.
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

    def is_driven(self, node: int) -> bool:
        """Return whether a motor puck reports torque mode; False if it is silent."""
        try:
            mode = self._properties.get(node, _MODE, _ANSWER_NS)
        except LinkError:
            return False
        return mode == PuckMode.TORQUE

    def driven(self) -> list[int]:
        """Return the motor pucks that report torque mode."""
        return [node for node in MOTOR_NODES if self.is_driven(node)]

    def idle_pucks(self, nodes: Collection[int]) -> None:
        """Set motor pucks to idle directly, if they missed the module's broadcast.

        Raises:
            LinkError: the bus is down.
        """
        for node in nodes:
            self._properties.set(node, _MODE, PuckMode.IDLE)

    def _ask_down(self) -> int | None:
        """Command IDLE once; return the reported MODE, None without a reply."""
        try:
            self._properties.set(SAFETY_NODE, _MODE, SafetyMode.IDLE)
            return self._properties.get(SAFETY_NODE, _MODE, _RETRY_NS)
        except LinkError:
            return None

    def is_zeroed(self) -> bool:
        """Return whether the positions were defined since power-up."""
        return self._get("ZERO") == 1

    def mark_zeroed(self) -> None:
        """Set the module's flag that positions are defined.

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
        """Clear the module's flag that positions are defined.

        Raises:
            DeviceFaultError: the module does not confirm.
        """
        self._set("ZERO", 0)
        if self.is_zeroed():
            raise DeviceFaultError(
                "The safety module does not accept ZERO = 0: a puck has lost its "
                "position, and the arm would pass for zeroed.",
                hint="Start again; if it stays so, switch the arm off and on.",
            )

    def ignore_speed_faults(self, count: int) -> None:
        """Make the module ignore `count` samples, before a jump of the positions."""
        self._set("IFAULT", count)

    def monitor_speed_faults(self) -> None:
        """Let the module monitor the speed again.

        Raises:
            DeviceFaultError: the module still ignores samples.
        """
        self.ignore_speed_faults(0)
        ignored = self._try_get("IFAULT")
        if ignored:
            raise DeviceFaultError(
                f"The safety module has IFAULT = {ignored}, expected 0: it would let "
                "so many samples beyond its speed limit pass.",
                hint="Start again; if it stays so, switch the arm off and on.",
            )

    def set_limits(self, limits: SafetyLimits) -> tuple[str, ...]:
        """Reset VL and TL to their power-up values, then set `limits`.

        Returns:
            Warnings for values that read back differently; libbarrett does not check.
        """
        wanted = limits.words()
        # An earlier program may have changed them; DEF and LOAD of a property's number
        # restore its power-up value.
        for name in wanted:
            number = property_number(Device.SAFETY, name, self._vers)
            self._set("DEF", number)
            self._set("LOAD", number)
        self.defaults = tuple(self._try_get(name) for name in wanted)
        for name, value in wanted.items():
            self._set(name, value)
        readback = {name: self._try_get(name) for name in wanted}
        return tuple(
            f"The safety module does not answer GET {name}; {value} was sent."
            if readback[name] is None
            else f"The safety module has {name} = {readback[name]}, expected {value}."
            for name, value in wanted.items()
            if readback[name] != value
        )

    def pendant(self, excused: Collection[str] = ()) -> PendantState:
        """Return pendant and monitors; those in `excused` may be UNKNOWN.

        Raises:
            DeviceFaultError: another monitor has an invalid state.
            LinkTimeoutError: the module is silent.
        """
        return decode_pendant(self._get("PEN") & 0xFFFFFFFF, excused)

    def pendant_with_warning(self) -> tuple[PendantState, str]:
        """Return pendant and monitors, and a warning if PEN is not as documented.

        A missing or invalid reply is not an error: libbarrett does not read PEN.
        """
        word = self._try_get("PEN")
        if word is None:
            return NO_PENDANT, "The safety module does not answer GET PEN."
        word &= 0xFFFFFFFF
        pendant = decode_pendant(word, MONITORS)
        if not pendant.inconsistent_monitors:
            return pendant, ""
        return pendant, (
            f"The pendant's word {word:08X} shows none or several states of: "
            f"{', '.join(pendant.inconsistent_monitors)}. "
            "Their faults would not be noticed."
        )

    def _get(self, name: str) -> int:
        return self._properties.require(SAFETY_NODE, self._number(name), name)

    def _try_get(self, name: str) -> int | None:
        return self._properties.get(SAFETY_NODE, self._number(name))

    def _number(self, name: str) -> int:
        return property_number(Device.SAFETY, name, self._vers)

    def _set(self, name: str, value: int) -> None:
        number = self._number(name)
        self._properties.set(SAFETY_NODE, number, value)
        self._properties.pause(_CONFIG_GAP_NS)
