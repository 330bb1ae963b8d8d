"""The frames of one cycle: positions asked for, torques sent, devices watched.

Time-outs follow the measured budget of one 2 ms cycle on a 1 Mbit/s bus.
"""

from dataclasses import dataclass
from typing import Final

from acquisition.clock import Clock
from acquisition.errors import DeviceFaultError, LinkError
from wam.arm_settings import ArmSettings
from wam.can_link import Link
from wam.frames import (
    MOTOR_NODES,
    Group,
    decode_position,
    encode_get,
    encode_torques,
    group_id,
    position_reply_id,
)
from wam.pucks import MODERN, Device, property_number
from wam.transmission import MOTORS
from wam.watch import Watch

_ARM_ID = group_id(Group.ARM)
_LOWER_ID, _WRIST_ID = group_id(Group.LOWER_TORQUE), group_id(Group.WRIST_TORQUE)
_POSITION_INDEX: Final = {position_reply_id(n): n - 1 for n in MOTOR_NODES}


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
        watch: safety module and pucks, asked in the free bus time.
        p_number: number of the property that holds a puck's position.
        counters: what was dropped so far.
    """

    def __init__(self, link: Link, clock: Clock, settings: ArmSettings) -> None:
        self.received: list[int | None] = [None] * MOTORS
        self.arm_ns = 0
        self.sent = [0] * MOTORS
        self.watch = Watch(link, settings)
        self.counters = LinkCounters()
        self._link = link
        self._clock = clock
        self._settings = settings
        self.set_firmware(MODERN)

    def set_firmware(self, vers: int) -> None:
        """Use the property numbers of puck firmware `vers`."""
        self.p_number = property_number(Device.MOTOR, "P", vers)
        self._get_p = encode_get(self.p_number)
        self._t_number = property_number(Device.MOTOR, "T", vers)

    def exchange(self, now_ns: int) -> None:
        """Ask for all positions at `now_ns`; waits until `give_up_ns` at most."""
        self.watch.begin_cycle()
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

    def ask(self, *, is_urgent: bool = False) -> None:
        """Use the free bus time for the question that is due; see `Watch.ask`."""
        try:
            self.watch.ask(is_urgent=is_urgent)
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
                else:
                    self.watch.hear(can_id, data)
            except DeviceFaultError:
                self.counters.malformed += 1
        return found
