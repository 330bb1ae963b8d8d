"""The seven simulated motor pucks of an arm, and the motors behind them."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Protocol

from acquisition.devices import SafetyMode
from fakes.pucks.event_queue import EventQueue
from fakes.pucks.motor_puck import READ_ONLY, MotorPuck
from fakes.pucks.options import NetworkOptions
from fakes.pucks.power import Power, PuckPower, power_after, power_at_start
from fakes.pucks.safety_module import puck_mode_in
from wam.bus.frames import (
    MOTOR_NODES,
    Property,
    encode_positions,
    wrap_positions,
)
from wam.bus.properties import PuckMode


class MotorSide(Protocol):
    """The motors and the arm behind the pucks."""

    def advance(self, t_ns: int) -> None:
        """Advance the simulated world to `t_ns`."""
        ...

    def counts(self) -> Sequence[int]:
        """Return the present encoder counts of the seven motors."""
        ...

    def set_torques(self, units: Sequence[int]) -> None:
        """Set the torques [puck units] of motors 1 to 7."""
        ...

    def short_windings(self, shorted: Sequence[bool]) -> None:
        """Short (damped) or open the windings of motors 1 to 7."""
        ...


class PuckBank:
    """Motor pucks 1 to 7: properties, torques, positions and power.

    Motors are advanced only to the instants at which a puck reads or drives them.
    `on_positions` is called with the positions [counts] by node that are reported at
    one instant.
    """

    def __init__(
        self,
        motors: MotorSide,
        options: NetworkOptions,
        schedule: EventQueue,
        on_positions: Callable[[Mapping[int, int]], None],
    ) -> None:
        self._motors = motors
        self._options = options
        self._schedule = schedule
        self._on_positions = on_positions
        self._mode = options.safety_mode
        self._pucks = [
            MotorPuck(PuckPower(node, options, schedule), options)
            for node in MOTOR_NODES
        ]
        self._deaf_nodes: set[int] = set()  # to the module
        self._members: dict[int, list[MotorPuck]] = {}
        self._reporting: dict[tuple[int, int], list[MotorPuck]] = {}
        self._power_up()

    def follow(self, mode: SafetyMode, before: SafetyMode) -> None:
        """Follow a change of the safety module from mode `before` to `mode`."""
        self._mode = mode
        if (power := power_after(mode, before)) is not None:
            for puck in self._pucks:
                puck.restart(power)
        self._forget_groups()
        self._set_puck_modes()

    def silence(self, node: int, *, is_mute: bool) -> None:
        """Cut or reconnect the transmit wire of a puck."""
        self._pucks[node - 1].life.cut(is_mute=is_mute)

    def set_bus_voltage(self, voltage: float) -> None:
        """Set the bus voltage [V] that the pucks measure."""
        for puck in self._pucks:
            puck.define("VBUS", round(voltage))

    def set_property(self, node: int, name: str, value: int) -> None:
        """Set a measured property of a puck, such as TEMP."""
        self._pucks[node - 1].define(name, value)

    def reboot(self, node: int) -> None:
        """Drop a puck into its monitor."""
        self._pucks[node - 1].restart(Power.MONITOR)
        self._forget_groups()
        self._apply()

    def deafen(self, node: int, *, is_deaf: bool) -> None:
        """Make a puck ignore, or follow again, the safety module's mode broadcasts."""
        (self._deaf_nodes.add if is_deaf else self._deaf_nodes.discard)(node)

    def driven(self) -> list[int]:
        """Return the nodes in torque mode."""
        return [puck.node for puck in self._pucks if puck.is_driven]

    def lose_mode(self, node: int) -> None:
        """Make a puck leave torque mode by itself."""
        puck = self._pucks[node - 1]
        puck.define("MODE", PuckMode.IDLE)
        puck.torque = 0
        self._apply()

    def restart_at_once(self, node: int) -> None:
        """Restart a puck without any downtime; mode and position are lost."""
        puck = self._pucks[node - 1]
        puck.restart(Power.AWAKE)
        self._lose_positions([puck])
        self._forget_groups()
        self._apply()

    def receive(self, node: int, request: Property) -> None:
        """Handle a GET or SET sent to one puck."""
        puck = self._pucks[node - 1]
        if puck.life.is_listening:
            self._get_or_set([puck], request)

    def receive_group(self, group: int, request: Property) -> None:
        """Handle a GET or SET sent to a group."""
        key = (group, request.number)
        if request.value is None and key in self._reporting:
            self._plan_report(self._reporting[key])
        else:
            self._get_or_set(self._group(group), request)

    def receive_torques(self, group: int, header: int, units: Sequence[int]) -> None:
        """Handle a torque frame: its first byte and four torques [puck units]."""
        for puck in self._group(group):
            if puck.t_header == header and puck.is_driven:
                puck.follow_torque(units[puck.slot])
        self._motors.advance(self._schedule.now_ns)
        self._motors.set_torques([puck.torque for puck in self._pucks])

    def _power_up(self) -> None:
        for puck in self._pucks:
            puck.restart(power_at_start(self._options))
        if not self._options.has_positions:
            self._lose_positions(self._pucks)
        self._set_puck_modes()

    def _get_or_set(self, pucks: list[MotorPuck], request: Property) -> None:
        number = request.number
        if request.value is not None:
            for puck in pucks:
                self._set_property(puck, number, request.value)
            return
        if feedback := _reporting_pucks(pucks, number):
            self._plan_report(feedback)
            return
        for puck in pucks:
            if (name := puck.name_of(number)) is not None:
                puck.life.answer(number, name, partial(self._value_of, puck))

    def _plan_report(self, pucks: list[MotorPuck]) -> None:
        self._schedule.after(self._options.latch_ns, partial(self._report, pucks))

    def _value_of(self, puck: MotorPuck, name: str) -> int | None:
        return puck.value_of(name, self._encoder_counts()[puck.node - 1])

    def _report(self, pucks: list[MotorPuck]) -> None:
        """Latch the positions of `pucks` and send them."""
        counts = self._encoder_counts()
        senders = [puck for puck in pucks if puck.life.is_speaking]
        if not senders:
            return
        positions = [counts[puck.node - 1] + puck.offset for puck in senders]
        for puck, data in zip(senders, encode_positions(positions), strict=True):
            self._schedule.emit(puck.position_id, data)
        nodes = [puck.node for puck in senders]
        self._on_positions(dict(zip(nodes, wrap_positions(positions), strict=True)))

    def _set_property(self, puck: MotorPuck, number: int, value: int) -> None:
        name = puck.name_of(number)
        if name == "STAT":
            self._restart(puck, value)
        elif not puck.is_awake or name is None or name in READ_ONLY:
            return
        elif name == "P":
            puck.offset = value - self._encoder_counts()[puck.node - 1]
        elif name == "T":
            puck.follow_torque(value)
            self._apply()
        else:
            puck.define(name, value)
            self._forget_groups()
            if name == "MODE":
                puck.torque = 0
                self._apply()

    def _restart(self, puck: MotorPuck, stat: int) -> None:
        """Carry out SET STAT: wake a sleeping puck, reset a running one."""
        change = puck.life.transition(stat)
        if change is None:
            return
        delay_ns, power = change
        puck.restart(Power.SILENT)

        def finish() -> None:
            puck.restart(power)
            self._lose_positions([puck])
            self._forget_groups()

        puck.life.later(delay_ns, finish)
        self._forget_groups()
        self._apply()

    def _set_puck_modes(self) -> None:
        for puck in self._pucks:
            if puck.node in self._deaf_nodes and self._mode is not SafetyMode.E_STOP:
                continue
            if puck.is_awake:
                puck.define("MODE", puck_mode_in(self._mode))
            puck.torque = 0
        self._apply()

    def _apply(self) -> None:
        """Pass the present torques and windings to the motors.

        The motor of a puck that restarts under an active module turns freely.
        """
        self._motors.advance(self._schedule.now_ns)
        is_active = self._mode is SafetyMode.ACTIVE
        self._motors.short_windings(
            [
                not (puck.is_driven or (is_active and not puck.is_awake))
                for puck in self._pucks
            ]
        )
        self._motors.set_torques([puck.torque for puck in self._pucks])

    def _encoder_counts(self) -> Sequence[int]:
        self._motors.advance(self._schedule.now_ns)
        return self._motors.counts()

    def _lose_positions(self, pucks: list[MotorPuck]) -> None:
        counts = self._encoder_counts()
        for puck in pucks:
            puck.lose_position(counts[puck.node - 1])

    def _group(self, group: int) -> list[MotorPuck]:
        members = self._members.get(group)
        if members is None:
            members = [p for p in self._pucks if p.hears(group)]
            self._members[group] = members
            for number in {p.p_number for p in members}:
                if feedback := _reporting_pucks(members, number):
                    self._reporting[group, number] = feedback
        return members

    def _forget_groups(self) -> None:
        """Drop the cached group members; they depend on properties and power."""
        self._members.clear()
        self._reporting.clear()


def _reporting_pucks(pucks: list[MotorPuck], number: int) -> list[MotorPuck]:
    """Return the running pucks whose property `number` is the position P."""
    return [p for p in pucks if p.p_number == number and p.life.power is Power.AWAKE]
