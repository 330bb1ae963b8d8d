"""The frames of one cycle: positions asked for, torques sent, the safety mode watched.

Time-outs follow the measured budget of one 2 ms cycle on a 1 Mbit/s bus.
"""

from dataclasses import dataclass
from typing import Final

from acquisition.clock import Clock
from acquisition.devices import SafetyMode
from acquisition.errors import LinkError
from wam.arm_settings import ArmSettings
from wam.can_link import Link
from wam.frames import (
    MOTOR_NODES,
    SAFETY_NODE,
    FrameError,
    Group,
    Payload,
    decode_position,
    decode_reply,
    encode_get,
    encode_torques,
    group_id,
    position_reply_id,
    property_reply_id,
)
from wam.pucks import MODERN, Device, property_number
from wam.safety import decode_mode
from wam.transmission import MOTORS

_MODE = 8  # the same in every firmware
_GET_MODE = encode_get(_MODE)
_SAFETY_REPLY_ID = property_reply_id(SAFETY_NODE)
_ARM_ID = group_id(Group.ARM)
_LOWER_ID, _WRIST_ID = group_id(Group.LOWER_TORQUE), group_id(Group.WRIST_TORQUE)
_POSITION_INDEX: Final = {position_reply_id(n): n - 1 for n in MOTOR_NODES}
_UNANSWERED_POLLS = 4  # this many questions without an answer: mode unknown


@dataclass(slots=True)
class LinkCounters:
    """What the loop dropped on its way, counted instead of logged.

    Attributes:
        stale: position replies that came after their cycle.
        rejected: positions that jumped.
        malformed: frames that contradict the protocol.
        link_errors: times the bus refused.
    """

    stale: int = 0
    rejected: int = 0
    malformed: int = 0
    link_errors: int = 0


class CycleTraffic:
    """What host and arm say to each other while the loop runs; never raises.

    Attributes:
        received: positions of this cycle [counts], motors 1 to 7, None = no reply.
        arm_ns: when the last of them arrived [ns], 0 = none did.
        sent: torques that the bus took last [puck units], motors 1 to 7.
        mode: last known mode of the safety module.
        p_number: number of the property that holds a puck's position.
        counters: what was dropped so far.
    """

    def __init__(self, link: Link, clock: Clock, settings: ArmSettings) -> None:
        self.received: list[int | None] = [None] * MOTORS
        self.arm_ns = 0
        self.sent = [0] * MOTORS
        self.mode = SafetyMode.UNKNOWN
        self.counters = LinkCounters()
        self._link = link
        self._clock = clock
        self._settings = settings
        self._until_poll = 0
        self._unanswered = 0
        self._hints_seen = 0
        self.set_firmware(MODERN)

    def set_firmware(self, vers: int) -> None:
        """Use the property numbers of puck firmware `vers`."""
        self.p_number = property_number(Device.MOTOR, "P", vers)
        self._get_p = encode_get(self.p_number)
        self._t_number = property_number(Device.MOTOR, "T", vers)

    def exchange(self, now_ns: int) -> None:
        """Ask for all positions at `now_ns`; waits until `give_up_ns` at most."""
        self._until_poll -= 1
        self.arm_ns = 0
        self.received = [None] * MOTORS
        try:
            self.counters.stale += self._collect()
            self.received = [None] * MOTORS
            self._link.send(_ARM_ID, self._get_p)
            self._await_replies(now_ns)
        except LinkError:
            self.counters.link_errors += 1

    def transmit(self, units: list[int]) -> bool:
        """Send torques [puck units]; return False when the bus refused a frame."""
        try:
            self._link.send(_LOWER_ID, encode_torques(units[:4], self._t_number))
            self.sent[:4] = units[:4]
            self._link.send(_WRIST_ID, encode_torques(units[4:], self._t_number))
            self.sent[4:] = units[4:]
        except LinkError:
            self.counters.link_errors += 1
            return False
        return True

    def watch_mode(self, *, is_urgent: bool = False) -> None:
        """Ask for the safety mode if it is time, `is_urgent`, or said to change.

        Only questions asked in their time count as unanswered: a burst of urgent ones
        on a dead bus must not turn the last known mode into UNKNOWN at once.
        """
        is_due = self._until_poll <= 0
        is_hinted = self._link.mode_hints != self._hints_seen
        if not (is_due or is_hinted or is_urgent):
            return
        self._hints_seen = self._link.mode_hints
        if is_due:
            self._until_poll = self._settings.safety_poll_cycles
            if self._unanswered >= _UNANSWERED_POLLS:
                self.mode = SafetyMode.UNKNOWN
            self._unanswered += 1
        try:
            self._link.send(SAFETY_NODE, _GET_MODE)
        except LinkError:
            self.counters.link_errors += 1

    def _await_replies(self, now_ns: int) -> None:
        clock, deadline_ns = self._clock, now_ns + self._settings.give_up_ns
        clock.sleep_until(now_ns + self._settings.first_look_ns)
        if self._collect():
            self.arm_ns = clock.now_ns()
        while None in self.received and clock.now_ns() < deadline_ns:
            if not clock.wait(self._link, deadline_ns):
                break
            if self._collect():
                self.arm_ns = clock.now_ns()

    def _collect(self) -> int:
        """Sort what has arrived and return how many positions there were."""
        found = 0
        for can_id, data, _ in self._link.receive():
            index = _POSITION_INDEX.get(can_id)
            try:
                if index is not None:
                    self.received[index] = decode_position(data)
                    found += 1
                elif can_id == _SAFETY_REPLY_ID:
                    self._note_mode(data)
            except FrameError:
                self.counters.malformed += 1
        return found

    def _note_mode(self, data: Payload) -> None:
        reply = decode_reply(data)
        if reply.number == _MODE and reply.value is not None:
            self.mode = decode_mode(reply.value)
            self._unanswered = 0
