"""A WAM's puck network without wires: frames in, frames out, time as an argument.

Seven motor pucks and the safety module as far as hosts have described them. What nobody
outside Barrett knows (boot time, heartbeat limit, content of the broadcast) is an
option or a plain choice, named where it is made.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from heapq import heappop, heappush
from typing import Literal, Protocol

from acquisition.devices import SafetyMode
from wam.frames import (
    GROUP_BIT,
    MOTOR_NODES,
    SAFETY_NODE,
    SENDER_MASK,
    FrameError,
    Group,
    Payload,
    compose_id,
    decode_request,
    decode_torques,
    encode_position,
    encode_reply,
    position_reply_id,
    property_reply_id,
)
from wam.pucks import (
    MAGNETIC_ENCODER,
    Device,
    PuckMode,
    Role,
    Stat,
    is_wide,
    names,
    property_number,
)
from wam.safety import Button, Level, PendantWord, encode_pendant

OutFrame = tuple[int, int, bytes]  # ready for the wire at [ns], identifier, data
PendantAction = Literal["activate", "idle", "estop"]
_TORQUE_GROUPS = (Group.LOWER_TORQUE, Group.WRIST_TORQUE)
_BROADCAST_ID = compose_id(SAFETY_NODE, Group.BUS, is_group=True)
_READ_ONLY = frozenset(("VERS", "ROLE", "SN", "ID", "ERROR", "TEMP", "PTEMP", "THERM"))
_POWER_UP_LIMITS = {"VL1": 2048, "VL2": 4096, "TL1": 4731, "TL2": 5204}
_ZERO_CHARACTER, _E_CHARACTER = 0x3F, 0x79  # seven-segment patterns


class MotorSide(Protocol):
    """The motors and the arm behind the pucks."""

    def advance(self, t_ns: int) -> None:
        """Let the world go on to `t_ns`."""
        ...

    def counts(self) -> Sequence[int]:
        """Return the encoder counts of the seven motors now."""
        ...

    def set_torques(self, units: Sequence[int]) -> None:
        """Apply these torques [puck units] to motors 1 to 7 from now on."""
        ...

    def set_braking(self, is_braked: bool, is_powered: bool) -> None:
        """Short the windings or not; without power the arm falls freely."""
        ...


@dataclass(frozen=True, slots=True)
class NetworkOptions:
    """The arm as it is found.

    Attributes:
        safety_mode: mode at the start; in E_STOP the pucks have no power.
        are_asleep: pucks wait in the monitor, as after power-up.
        is_zeroed: a host has defined the positions (never when asleep or E_STOP).
        vers: firmware of each motor puck.
        monitor_vers: what VERS says while a puck sleeps.
        safety_vers: firmware of the safety module.
        cts, ipnm, poles, mt: constants of each motor puck.
        boot_ns: silence of a puck that was woken.
        reset_ns: silence of a puck that was reset.
        latch_ns: from the end of a request to the latched position.
        heartbeat_ns: longest time without position traffic while ACTIVE.
    """

    safety_mode: SafetyMode = SafetyMode.IDLE
    are_asleep: bool = False
    is_zeroed: bool = True
    vers: tuple[int, ...] = (200,) * 7
    monitor_vers: int = 5
    safety_vers: int = 200
    cts: tuple[int, ...] = (4096,) * 7
    ipnm: tuple[int, ...] = (2700, 2700, 2700, 2700, 6500, 6500, 17474)
    poles: tuple[int, ...] = (12, 12, 12, 12, 8, 8, 6)
    mt: tuple[int, ...] = (4860, 4860, 4860, 4320, 3900, 3900, 1600)
    boot_ns: int = 600_000_000
    reset_ns: int = 500_000_000
    latch_ns: int = 75_000
    heartbeat_ns: int = 100_000_000


class _Power(Enum):
    OFF = "no power"
    MONITOR = "asleep"
    SILENT = "booting or resetting"
    AWAKE = "running"


class _Puck:
    """State of one motor puck."""

    def __init__(self, node: int, options: NetworkOptions) -> None:
        i = node - 1
        self.node = node
        self.vers = options.vers[i]
        self.monitor_vers = options.monitor_vers
        self.power = _Power.OFF
        self.epoch = 0  # events of an earlier life are void
        self.is_mute = False
        self.offset = 0  # position = encoder counts + offset
        self.torque = 0
        self.p_number = property_number(Device.MOTOR, "P", self.vers)
        self.t_header = 0x80 | property_number(Device.MOTOR, "T", self.vers)
        self.properties = {
            "ROLE": MAGNETIC_ENCODER | Role.TATER,
            **{"SN": 1000 + node, "ID": node, "ERROR": 0, "MODE": PuckMode.IDLE},
            **{"TEMP": 35, "PTEMP": 60, "OTEMP": 60, "THERM": 33, "VBUS": 48},
            **{"GRPA": 0, "GRPB": 1 if node <= 4 else 2, "GRPC": 4},
            **{"CTS": options.cts[i], "IPNM": options.ipnm[i], "MT": options.mt[i]},
            **{"POLES": options.poles[i], "ECMIN": 0, "ECMAX": 0},
            **{"PIDX": node if node <= 4 else node - 4, "JIDX": node},
        }

    def hears(self, group: int) -> bool:
        """Return whether the puck belongs to `group` and runs."""
        mine = (self.properties[name] for name in ("GRPA", "GRPB", "GRPC"))
        return self.power in (_Power.AWAKE, _Power.MONITOR) and group in mine

    def name_of(self, number: int) -> str | None:
        """Return what `number` means to the puck as it is now."""
        if self.power is _Power.MONITOR:
            return names(Device.MONITOR).get(number)
        return names(Device.MOTOR, self.vers).get(number)

    def value_of(self, name: str, counts: int) -> int | None:
        """Return the value of a property, None for one that is not modelled."""
        is_asleep = self.power is _Power.MONITOR
        computed = {
            "VERS": self.monitor_vers if is_asleep else self.vers,
            "STAT": Stat.RESET if is_asleep else Stat.READY,
            "MECH": counts % (self.properties["CTS"] or 1),
            "T": self.torque,
        }
        return computed.get(name, self.properties.get(name))

    def restart(self, power: _Power) -> None:
        """Lose what a puck loses with its program."""
        self.epoch += 1
        self.power = power
        self.torque = 0
        self.properties["MODE"] = PuckMode.IDLE

    def lose_position(self, counts: int) -> None:
        """Count from within one turn again, as the magnetic encoder sees it."""
        self.offset = counts % (self.properties["CTS"] or 1) - counts


class PuckNetwork:
    """The network as a host sees it: `receive` frames, `advance`, take what is `due`.

    Motors are advanced to the instants at which pucks touch them and no further.
    """

    def __init__(
        self, motors: MotorSide, options: NetworkOptions | None = None, t_ns: int = 0
    ) -> None:
        self.options = options or NetworkOptions()
        self._motors = motors
        self._now_ns = t_ns
        self._events: list[tuple[int, int, Callable[[], None]]] = []
        self._event_count = 0
        self._outbox: list[OutFrame] = []
        self._pucks = [_Puck(node, self.options) for node in MOTOR_NODES]
        self._members: dict[int, list[_Puck]] = {}
        self._mute_safety = False
        self._mode = self.options.safety_mode
        self._last_position_ns = t_ns
        self._levels: dict[str, Level] = dict.fromkeys(
            ("velocity", "torque", "voltage", "heartbeat", "other"), Level.SAFE
        )
        self._largest_command: dict[Group, int] = dict.fromkeys(_TORQUE_GROUPS, 0)
        self._safety = {
            **{"VERS": self.options.safety_vers, "ROLE": int(Role.SAFETY)},
            **{"SN": 1010, "ID": SAFETY_NODE, "ERROR": 0, "STAT": int(Stat.READY)},
            **{"GRPA": 1, "GRPB": 2, "GRPC": 3, "SAFE": 0, "IFAULT": 0, "ZERO": 0},
            **{"VOLTL1": 36, "VOLTL2": 30, "VOLTH1": 54, "VOLTH2": 57, "VNOM": 48},
            **_POWER_UP_LIMITS,
        }
        self._wake_up_rig()

    @property
    def safety_mode(self) -> SafetyMode:
        """The true mode of the safety module."""
        return self._mode

    @property
    def pendant_word(self) -> PendantWord:
        """What the pendant shows."""
        is_stopped = self._mode is SafetyMode.E_STOP
        return PendantWord(
            **self._levels,
            segments=_E_CHARACTER if is_stopped else _ZERO_CHARACTER,
            is_idle_lit=self._mode is SafetyMode.IDLE,
            is_active_lit=self._mode is SafetyMode.ACTIVE,
            button=Button.E_STOP if is_stopped else Button.NONE,
        )

    def advance(self, t_ns: int) -> None:
        """Let everything happen that happens until `t_ns`, in order of time."""
        while (next_ns := self.next_event_ns()) is not None and next_ns <= t_ns:
            self._now_ns = max(next_ns, self._now_ns)
            if self._events and self._events[0][0] <= next_ns:
                heappop(self._events)[2]()
            else:
                self._fault("heartbeat")
        self._now_ns = max(t_ns, self._now_ns)

    def next_event_ns(self) -> int | None:
        """Return when the network does something of its own accord next."""
        next_ns = self._events[0][0] if self._events else None
        if self._mode is SafetyMode.ACTIVE:
            beat_ns = self._last_position_ns + self.options.heartbeat_ns
            return beat_ns if next_ns is None else min(beat_ns, next_ns)
        return next_ns

    def due(self, t_ns: int) -> list[OutFrame]:
        """Advance to `t_ns` and return the frames that want onto the wire by then."""
        self.advance(t_ns)
        frames, self._outbox = self._outbox, []
        return frames

    def receive(self, t_ns: int, can_id: int, data: Payload) -> None:
        """Take a host's frame whose last bit arrived at `t_ns`."""
        self.advance(t_ns)
        if can_id & SENDER_MASK:
            return
        to = can_id & 0x1F
        try:
            if not can_id & GROUP_BIT:
                self._receive_directed(to, data)
            elif to in _TORQUE_GROUPS and len(data) == 8:
                self._receive_torques(Group(to), data)
            else:
                self._ask_or_tell(self._group(to), data)
        except FrameError:
            return  # devices do not answer what they do not understand

    def pendant(self, action: PendantAction) -> None:
        """Press a button of the pendant, at the time of the last `advance`."""
        if action == "estop":
            self._levels["other"] = Level.FAULT
            self._enter(SafetyMode.E_STOP)
        elif action == "idle":
            self._levels = dict.fromkeys(self._levels, Level.SAFE)
            self._enter(SafetyMode.IDLE)
            self._judge_torque()
        elif self._mode is SafetyMode.IDLE and not self.pendant_word.faults:
            self._enter(SafetyMode.ACTIVE)

    def silence(self, node: int, *, is_mute: bool = True) -> None:
        """Cut the transmit wire of a node, or mend it; it still hears."""
        if node == SAFETY_NODE:
            self._mute_safety = is_mute
        else:
            self._pucks[node - 1].is_mute = is_mute

    def reboot(self, node: int) -> None:
        """Let a motor puck fall into its monitor: no torque, position lost."""
        self._pucks[node - 1].restart(_Power.MONITOR)
        self._membership_changed()
        self._apply()

    def _wake_up_rig(self) -> None:
        is_off = self._mode is SafetyMode.E_STOP
        is_asleep = self.options.are_asleep
        power = _Power.MONITOR if is_asleep else _Power.AWAKE
        for puck in self._pucks:
            puck.restart(_Power.OFF if is_off else power)
        is_zeroed = self.options.is_zeroed and not is_off and not is_asleep
        self._safety["ZERO"] = int(is_zeroed)
        if not is_zeroed:
            self._lose_positions(self._pucks)
        self._levels["other"] = Level.FAULT if is_off else Level.SAFE
        self._set_puck_modes()

    def _receive_directed(self, node: int, data: Payload) -> None:
        if node == SAFETY_NODE:
            self._ask_or_tell_safety(data)
        elif node in MOTOR_NODES:
            puck = self._pucks[node - 1]
            if puck.power in (_Power.AWAKE, _Power.MONITOR):
                self._ask_or_tell([puck], data)

    def _receive_torques(self, group: Group, data: Payload) -> None:
        units = decode_torques(data)
        for puck in self._group(group):
            if puck.t_header == data[0] and puck.properties["MODE"] == PuckMode.TORQUE:
                limit = puck.properties["MT"]
                unit = units[(puck.properties["PIDX"] - 1) & 3]
                puck.torque = max(-limit, min(unit, limit))
        # The module judges the command, before a puck clips it.
        self._largest_command[group] = max(map(abs, units))
        self._apply()
        self._judge_torque()

    def _ask_or_tell(self, pucks: list[_Puck], data: Payload) -> None:
        request = decode_request(data)
        if request.value is not None:
            for puck in pucks:
                self._tell(puck, request.number, request.value)
            return
        feedback = [
            p for p in pucks if p.p_number == request.number and p.power is _Power.AWAKE
        ]
        if feedback:
            self._after(self.options.latch_ns, lambda: self._report(feedback))
            return
        for puck in pucks:
            if (name := puck.name_of(request.number)) is not None:
                self._answer_later(puck, request.number, name)

    def _answer_later(self, puck: _Puck, number: int, name: str) -> None:
        epoch = puck.epoch

        def answer() -> None:
            if puck.epoch != epoch or puck.is_mute:
                return
            value = puck.value_of(name, self._encoder_counts()[puck.node - 1])
            if value is not None:
                self._reply(puck.node, number, value, is_wide=is_wide(name))

        # A choice within the 75 to 150 us that are known.
        self._after(self.options.latch_ns + 10_000 * puck.node, answer)

    def _report(self, pucks: list[_Puck]) -> None:
        """Latch the positions of `pucks` and hand them to the wire."""
        counts = self._encoder_counts()
        for puck in pucks:
            if puck.power is _Power.AWAKE and not puck.is_mute:
                position = encode_position(counts[puck.node - 1] + puck.offset)
                self._emit(position_reply_id(puck.node), position)
                self._last_position_ns = self._now_ns

    def _tell(self, puck: _Puck, number: int, value: int) -> None:
        name = puck.name_of(number)
        if name == "STAT":
            self._restart(puck, value)
        elif puck.power is _Power.MONITOR or name is None or name in _READ_ONLY:
            return
        elif name == "P":
            puck.offset = value - self._encoder_counts()[puck.node - 1]
        elif name == "T":
            if puck.properties["MODE"] == PuckMode.TORQUE:
                limit = puck.properties["MT"]
                puck.torque = max(-limit, min(value, limit))
                self._apply()
        else:
            puck.properties[name] = value
            self._membership_changed()
            if name == "MODE":
                puck.torque = 0
                self._apply()

    def _restart(self, puck: _Puck, stat: int) -> None:
        """Obey SET STAT: wake a sleeping puck, reset a running one."""
        if stat == Stat.READY and puck.power is _Power.MONITOR:
            delay_ns, power = self.options.boot_ns, _Power.AWAKE
        elif stat == Stat.RESET and puck.power is _Power.AWAKE:
            delay_ns, power = self.options.reset_ns, _Power.MONITOR
        else:
            return
        puck.restart(_Power.SILENT)
        epoch = puck.epoch

        def finish() -> None:
            if puck.epoch == epoch:
                puck.restart(power)
                self._lose_positions([puck])
                self._membership_changed()

        self._after(delay_ns, finish)
        self._membership_changed()
        self._apply()

    def _ask_or_tell_safety(self, data: Payload) -> None:
        request = decode_request(data)
        name = names(Device.SAFETY, self.options.safety_vers).get(request.number)
        if request.value is not None:
            self._tell_safety(name, request.value)
        elif name is not None:
            number = request.number
            self._after(self.options.latch_ns, lambda: self._answer(number, name))

    def _answer(self, number: int, name: str) -> None:
        computed = {"MODE": int(self._mode), "PEN": encode_pendant(self.pendant_word)}
        value = computed.get(name, self._safety.get(name))
        if value is not None and not self._mute_safety:
            self._reply(SAFETY_NODE, number, value, is_wide=is_wide(name))

    def _tell_safety(self, name: str | None, value: int) -> None:
        if name == "MODE":
            if 0 <= value < self._mode:  # a host can lower the mode only
                self._enter(SafetyMode(value))
        elif name in ("DEF", "LOAD"):
            limit = names(Device.SAFETY, self.options.safety_vers).get(value)
            if limit in _POWER_UP_LIMITS:
                self._safety[limit] = _POWER_UP_LIMITS[limit]
        elif name in self._safety and name not in _READ_ONLY and name != "STAT":
            self._safety[name] = value

    def _judge_torque(self) -> None:
        largest = max(self._largest_command.values())
        if self._mode is SafetyMode.ACTIVE and largest > self._safety["TL2"]:
            self._fault("torque")
        elif self._levels["torque"] is not Level.FAULT:
            is_high = largest > self._safety["TL1"]
            self._levels["torque"] = Level.WARNING if is_high else Level.SAFE

    def _fault(self, monitor: str) -> None:
        """Note a fault until Shift-idle and stop the arm."""
        self._levels[monitor] = Level.FAULT
        self._enter(SafetyMode.IDLE)

    def _enter(self, mode: SafetyMode) -> None:
        if mode is self._mode:
            return
        was_off = self._mode is SafetyMode.E_STOP
        self._mode = mode
        if mode is SafetyMode.E_STOP:
            self._safety["ZERO"] = 0
        for puck in self._pucks:
            if mode is SafetyMode.E_STOP:
                puck.restart(_Power.OFF)
            elif was_off:
                puck.restart(_Power.MONITOR)
        self._last_position_ns = self._now_ns
        self._emit(_BROADCAST_ID, encode_reply(8, self._puck_mode(), is_wide=False))
        self._membership_changed()
        self._set_puck_modes()

    def _puck_mode(self) -> PuckMode:
        is_active = self._mode is SafetyMode.ACTIVE
        return PuckMode.TORQUE if is_active else PuckMode.IDLE

    def _set_puck_modes(self) -> None:
        for puck in self._pucks:
            if puck.power is _Power.AWAKE:
                puck.properties["MODE"] = self._puck_mode()
            puck.torque = 0
        self._apply()

    def _apply(self) -> None:
        """Hand the torques and brakes as they are now to the motors."""
        self._motors.advance(self._now_ns)
        is_driven = any(p.properties["MODE"] == PuckMode.TORQUE for p in self._pucks)
        is_powered = self._mode is not SafetyMode.E_STOP
        self._motors.set_braking(is_powered and not is_driven, is_powered)
        self._motors.set_torques([puck.torque for puck in self._pucks])

    def _encoder_counts(self) -> Sequence[int]:
        self._motors.advance(self._now_ns)
        return self._motors.counts()

    def _lose_positions(self, pucks: list[_Puck]) -> None:
        counts = self._encoder_counts()
        for puck in pucks:
            puck.lose_position(counts[puck.node - 1])

    def _group(self, group: int) -> list[_Puck]:
        if group not in self._members:
            self._members[group] = [p for p in self._pucks if p.hears(group)]
        return self._members[group]

    def _membership_changed(self) -> None:
        self._members.clear()

    def _reply(self, node: int, number: int, value: int, *, is_wide: bool) -> None:
        if not is_wide:
            value = (value + 0x8000) % 0x10000 - 0x8000  # a host may set any number
        data = encode_reply(number, value, is_wide=is_wide)
        self._emit(property_reply_id(node), data)

    def _emit(self, can_id: int, data: bytes) -> None:
        self._outbox.append((self._now_ns, can_id, data))

    def _after(self, delay_ns: int, action: Callable[[], None]) -> None:
        self._event_count += 1  # keeps events of one instant in their order
        heappush(self._events, (self._now_ns + delay_ns, self._event_count, action))
