"""The simulated safety module: mode, pendant and monitors.

Neither the heartbeat timeout nor the content of the broadcast is known outside Barrett:
the timeout is an option, the content is assumed to be the mode that the pucks enter.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Literal

from acquisition.devices import SafetyMode
from acquisition.simulation import PendantAction
from fakes.pucks.event_queue import NEVER, EventQueue
from fakes.pucks.options import NetworkOptions
from fakes.pucks.speed_monitor import SpeedMonitor
from wam.bus.frames import SAFETY_NODE, Group, Property, compose_id, encode_reply
from wam.bus.properties import (
    Device,
    PuckMode,
    PuckRole,
    PuckStatus,
    names,
    nearest_documented,
)
from wam.driver.pendant import (
    MONITORS,
    PendantButton,
    PendantState,
    SafetyLevel,
    encode_pendant,
)
from wam.driver.safety_module import COUNTS_PER_SPEED

Strainable = Literal["velocity", "torque", "heartbeat"]
TORQUE_GROUPS = (Group.LOWER_TORQUE, Group.WRIST_TORQUE)
_MODE = 8  # number of the property in every firmware
_BROADCAST_ID = compose_id(SAFETY_NODE, Group.BUS, is_group=True)
_READ_ONLY = frozenset(("VERS", "ROLE", "SN", "ID", "ERROR", "STAT"))
_POWER_UP_LIMITS = {
    "VL1": 2048,
    "VL2": 4096,
    "TL1": 4731,
    "TL2": 5204,
    "VOLTL1": 36,
    "VOLTL2": 30,
    "VOLTH1": 54,
    "VOLTH2": 57,
}
_FAULT_LIMITS = {"velocity": "VL2", "torque": "TL2"}
NOMINAL_VOLTAGE = 48.0  # of the power bus [V]
_MAX_OVERSPEED_NS = 500_000_000  # above VL2 for longer than this removes the power
_ZERO_CHARACTER, _E_CHARACTER = 0x3F, 0x79  # seven-segment patterns


def puck_mode_in(mode: SafetyMode) -> PuckMode:
    """Return the mode that the pucks enter when the module enters `mode`."""
    return PuckMode.TORQUE if mode is SafetyMode.ACTIVE else PuckMode.IDLE


class FakeSafetyModule:
    """State of the safety module, which answers hosts and monitors their traffic.

    `on_change(before)` is called after a change of mode.

    Attributes:
        mode: the true mode.
        is_mute: its transmit wire is cut.
        is_disobedient: it ignores a host that lowers its mode.
        reports_idle: it reports IDLE whatever its mode.
        dead_button: a pendant button without effect; None = none.
        limit_factors: by name, the ratio of the stored limit to the value a host sets.
    """

    def __init__(
        self,
        options: NetworkOptions,
        schedule: EventQueue,
        on_change: Callable[[SafetyMode], None],
    ) -> None:
        self.mode = options.safety_mode
        self.is_mute = False
        self.is_disobedient = False
        self.reports_idle = False
        self.dead_button: PendantAction | None = None
        self.limit_factors: dict[str, float] = {}
        self._heartbeat_ns = options.heartbeat_ns
        self._options = options
        vers = nearest_documented(options.safety_vers)
        self._names = names(Device.SAFETY, vers)
        self._schedule = schedule
        self._on_change = on_change
        self._levels: dict[str, SafetyLevel] = dict.fromkeys(MONITORS, SafetyLevel.SAFE)
        if not options.has_power:
            self._levels["other"] = SafetyLevel.FAULT
        self._speeds = SpeedMonitor(options.cts)
        self._too_fast_since_ns: int | None = None
        self._bus_voltage = NOMINAL_VOLTAGE
        self._is_deaf = False
        self._saved_limits: dict[str, int] = {}  # limits before `trip`
        # Largest torques commanded last [puck units].
        self._largest_torques: dict[int, int] = dict.fromkeys(TORQUE_GROUPS, 0)
        self._properties = {
            "VERS": options.safety_vers,
            "ROLE": int(PuckRole.SAFETY),
            "SN": 1010,
            "ID": SAFETY_NODE,
            "ERROR": 0,
            "STAT": int(PuckStatus.READY),
            "GRPA": 1,
            "GRPB": 2,
            "GRPC": 3,
            "SAFE": 0,
            "IFAULT": 0,
            "VNOM": round(NOMINAL_VOLTAGE),
            "ZERO": int(options.has_positions),
            **_POWER_UP_LIMITS,
        }
        schedule.define_alarm(self._expire_heartbeat)
        self._restart_heartbeat()

    @property
    def pendant_state(self) -> PendantState:
        """The state that the pendant shows."""
        is_stopped = self.mode is SafetyMode.E_STOP
        return PendantState(
            **self._levels,
            segments=_E_CHARACTER if is_stopped else _ZERO_CHARACTER,
            is_idle_lit=self.mode is SafetyMode.IDLE,
            is_active_lit=self.mode is SafetyMode.ACTIVE,
            button=PendantButton.E_STOP if is_stopped else PendantButton.NONE,
        )

    def press(self, action: PendantAction) -> None:
        """Press a button of the pendant."""
        if action == self.dead_button:
            return
        if action == "estop":
            self._levels["other"] = SafetyLevel.FAULT
            self._enter(SafetyMode.E_STOP)
        elif action == "idle":
            self._levels = dict.fromkeys(self._levels, SafetyLevel.SAFE)
            self._enter(SafetyMode.IDLE)
            self._check_torque()
            self._check_voltage()
        elif self.mode is SafetyMode.IDLE and not self.pendant_state.faults:
            self._enter(SafetyMode.ACTIVE)

    def forget_positions(self) -> None:
        """Forget where the joints are, as after power-up."""
        self._properties["ZERO"] = 0
        self._speeds.reset()

    def receive(self, request: Property) -> None:
        """Handle a GET or SET sent to the module."""
        number = request.number
        name = self._names.get(number)
        if request.value is not None:
            self._set_property(name, request.value)
        elif name is not None:
            self._schedule.after(
                self._options.latch_ns, lambda: self._answer(number, name)
            )

    def set_bus_voltage(self, voltage: float) -> None:
        """Set the voltage of the power bus [V]."""
        self._bus_voltage = voltage
        self._check_voltage()

    def set_heartbeat(self, heartbeat_ns: int) -> None:
        """Set the heartbeat timeout [ns]."""
        self._heartbeat_ns = heartbeat_ns
        self._restart_heartbeat()

    def trip(self, monitor: Strainable) -> None:
        """Make a monitor report a fault, until `reset_monitors`.

        The limits of speed and torque become the smallest value that is not off; for
        the heartbeat the module ignores positions.
        """
        limit = _FAULT_LIMITS.get(monitor)
        if limit is None:
            self._is_deaf = True
        else:
            self._saved_limits.setdefault(limit, self._properties[limit])
            self._properties[limit] = 1

    def reset_monitors(self) -> None:
        """Restore the monitors; a fault stays until Shift-idle."""
        self._is_deaf = False
        self._properties.update(self._saved_limits)
        self._saved_limits.clear()

    def handle_positions(self, positions: Mapping[int, int]) -> None:
        """Update heartbeat and speed with positions [counts] by node."""
        if self._is_deaf:
            return
        self._restart_heartbeat()
        self._speeds.on_positions(self._schedule.now_ns, positions)
        self._check_speed()

    def handle_torques(self, group: int, units: Sequence[int]) -> None:
        """Check a torque command as sent on the bus, before a puck clips it."""
        self._largest_torques[group] = max(map(abs, units))
        self._check_torque()

    def _restart_heartbeat(self) -> None:
        """Restart the watchdog (heartbeat monitor), while ACTIVE."""
        is_active = self.mode is SafetyMode.ACTIVE
        due_ns = self._schedule.now_ns + self._heartbeat_ns
        self._schedule.set_alarm(due_ns if is_active else NEVER)

    def _expire_heartbeat(self) -> None:
        """Fault the arm: the watchdog (heartbeat monitor) has timed out."""
        self._fault("heartbeat")

    def _answer(self, number: int, name: str) -> None:
        mode = SafetyMode.IDLE if self.reports_idle else self.mode
        computed = {"MODE": int(mode), "PEN": encode_pendant(self.pendant_state)}
        value = computed.get(name, self._properties.get(name))
        if value is not None and not self.is_mute:
            self._schedule.reply(SAFETY_NODE, number, name, value)

    def _set_property(self, name: str | None, value: int) -> None:
        if name == "MODE":
            # A host can only lower the mode.
            if 0 <= value < self.mode and not self.is_disobedient:
                self._enter(SafetyMode(value))
        elif name in ("DEF", "LOAD"):
            limit = self._names.get(value)
            if limit in _POWER_UP_LIMITS:
                self._properties[limit] = _POWER_UP_LIMITS[limit]
        elif name in self._properties and name not in _READ_ONLY:
            self._properties[name] = round(value * self.limit_factors.get(name, 1.0))
            self._check_voltage()

    def _check_speed(self) -> None:
        """Compare the speed with VL1 and VL2; a limit of 0 or less is off."""
        limits = self._properties
        is_zeroed = limits["ZERO"] == 1
        speed = self._speeds.tip_speed() if is_zeroed else self._speeds.joint_speed()
        counts = speed * COUNTS_PER_SPEED
        if counts <= limits["VL2"] or limits["VL2"] <= 0:
            self._too_fast_since_ns = None
            self._warn("velocity", is_warning=counts > limits["VL1"] > 0)
        elif limits["IFAULT"] > 0:
            limits["IFAULT"] -= 1
        else:
            self._fault("velocity")
            self._stop_if_still_too_fast()

    def _stop_if_still_too_fast(self) -> None:
        now_ns = self._schedule.now_ns
        if self._too_fast_since_ns is None:
            self._too_fast_since_ns = now_ns
        if now_ns - self._too_fast_since_ns >= _MAX_OVERSPEED_NS:
            self._enter(SafetyMode.E_STOP)

    def _check_voltage(self) -> None:
        limits, voltage = self._properties, self._bus_voltage
        if self.mode is SafetyMode.E_STOP:
            return  # the bus has no power
        if not limits["VOLTL2"] <= voltage <= limits["VOLTH2"]:
            self._levels["voltage"] = SafetyLevel.FAULT
            self._enter(SafetyMode.E_STOP)  # assumed: the true reaction is not known
        else:
            is_outside = not limits["VOLTL1"] <= voltage <= limits["VOLTH1"]
            self._warn("voltage", is_warning=is_outside)

    def _warn(self, monitor: str, *, is_warning: bool) -> None:
        """Set or clear a warning; a fault stays until Shift-idle."""
        if self._levels[monitor] is not SafetyLevel.FAULT:
            self._levels[monitor] = (
                SafetyLevel.WARNING if is_warning else SafetyLevel.SAFE
            )

    def _check_torque(self) -> None:
        largest = max(self._largest_torques.values())
        if self.mode is SafetyMode.ACTIVE and largest > self._properties["TL2"]:
            self._fault("torque")
        else:
            self._warn("torque", is_warning=largest > self._properties["TL1"])

    def _fault(self, monitor: str) -> None:
        """Latch a fault until Shift-idle and stop the arm."""
        self._levels[monitor] = SafetyLevel.FAULT
        if self.mode is SafetyMode.ACTIVE:
            self._enter(SafetyMode.IDLE)

    def _enter(self, mode: SafetyMode) -> None:
        if mode is self.mode:
            return
        before, self.mode = self.mode, mode
        if mode is SafetyMode.E_STOP:
            self._properties["ZERO"] = 0
            self._speeds.reset()
            self._too_fast_since_ns = None
        self._restart_heartbeat()
        frame = encode_reply(_MODE, puck_mode_in(mode), is_wide=False)
        self._schedule.emit(_BROADCAST_ID, frame)
        self._on_change(before)
