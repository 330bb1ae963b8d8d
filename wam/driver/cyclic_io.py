"""Bus traffic of one cycle: position requests, torques, status polling.

Time-outs follow the measured budget of a 2 ms cycle on a 1 Mbit/s bus.
"""

from dataclasses import dataclass, field
from typing import Final, Protocol

from acquisition.clock import Clock
from acquisition.devices import BusCondition
from acquisition.errors import DeviceFaultError, LinkError, LinkFullError
from wam.bus.frames import (
    MOTOR_NODES,
    Group,
    Payload,
    decode_position,
    encode_get,
    encode_torques,
    group_id,
    position_reply_id,
)
from wam.bus.link import Link
from wam.bus.properties import MODERN, Device, nearest_documented, property_number
from wam.driver.reply_balance import ReplyBalance
from wam.driver.settings import ArmSettings
from wam.driver.status_poller import StatusPoller
from wam.driver.transmission import MOTORS

_ARM_ID = group_id(Group.ARM)
_LOWER_ID, _WRIST_ID = group_id(Group.LOWER_TORQUE), group_id(Group.WRIST_TORQUE)
_MARGIN_NS = 200_000  # variation of the duration of an exchange
_POSITION_INDEX: Final = {position_reply_id(n): n - 1 for n in MOTOR_NODES}


@dataclass(slots=True)
class LinkCounters:
    """Counters of communication errors; the loop counts instead of logging.

    Attributes:
        missing: position requests without a reply, motors 1 to 7.
        stale: position replies after the end of their cycle, or duplicate.
        late: position replies in cycles without a request: they answer an earlier cycle
            that seemed complete.
        rejected: implausible positions.
        malformed: frames that violate the protocol.
        link_errors: frames refused by the bus.
        withheld: torques not sent because earlier frames were still queued.
        link: the CAN link, for its own counters.
    """

    link: Link
    missing: list[int] = field(default_factory=lambda: [0] * MOTORS)
    stale: int = 0
    late: int = 0
    rejected: int = 0
    malformed: int = 0
    link_errors: int = 0
    withheld: int = 0

    def text(self) -> str:
        """Return the counters in one line."""
        return ", ".join(f"{name} {value}" for name, value in self.metadata().items())

    def metadata(self) -> dict[str, str]:
        """Return the counters as metadata of a recording, motors 1 to 7 in one line."""
        return {
            "link:missing_replies": " ".join(map(str, self.missing)),
            "link:late_replies": str(self.stale),
            "link:replies_to_earlier_cycles": str(self.late),
            "link:rejected_jumps": str(self.rejected),
            "link:malformed_frames": str(self.malformed),
            "link:bus_errors": str(self.link_errors),
            "link:withheld_torques": str(self.withheld),
            "link:error_frames": self.link.errors.text() or "none",
            **self.link.metadata(),
        }


class BusDevice(Protocol):
    """A device polled along with the positions, such as a wrist sensor.

    The loop never waits for it; a reply may arrive in a later cycle.
    """

    def poll_frame(self, t_ns: int) -> tuple[int, bytes]:
        """Return identifier and payload of the request sent at `t_ns`."""
        ...

    def on_frame(self, can_id: int, data: Payload) -> None:
        """Handle a frame other than a position, of any device; never raises."""
        ...


class CycleTraffic:
    """Bus traffic of the running loop; never raises.

    Attributes:
        received: positions of this cycle [counts], motors 1 to 7, None = no reply.
        arm_ns: arrival time of the last reply [ns], 0 = none.
        bus_ns: bus time of the last reply [ns], 0 = not known.
        sent: torques last accepted by the bus [puck units], motors 1 to 7.
        sent_ns: time of acceptance [ns], 0 = never.
        poller: poller of safety module and pucks in the free bus time.
        bus_device: other device, polled right after the position request.
        counters: error counters.
        balance: balance of position replies and requests.
        condition: condition of the bus at the last position request.
        took_ns: duration of the last complete exchange [ns].
    """

    def __init__(self, link: Link, clock: Clock, settings: ArmSettings) -> None:
        self.received: list[int | None] = [None] * MOTORS
        self.arm_ns = 0
        self.bus_ns = 0
        self.sent = [0] * MOTORS
        self.sent_ns = 0
        self.poller = StatusPoller(link, settings)
        self.bus_device: BusDevice | None = None
        self.counters = LinkCounters(link)
        self.balance = ReplyBalance()
        self.condition = BusCondition.SOUND
        self.took_ns = 0
        self._asked_ns = 0  # last position request
        self._errors_seen = 0  # error frames
        self._owed = 0  # bit i set = motor i+1 may still answer an earlier request
        self._link = link
        self._clock = clock
        self._settings = settings
        self.set_firmware(MODERN)

    def set_firmware(self, vers: int) -> None:
        """Use the property numbers of puck firmware `vers`."""
        vers = nearest_documented(vers)
        self.p_number = property_number(Device.MOTOR, "P", vers)
        self._get_p = encode_get(self.p_number)
        self._t_number = property_number(Device.MOTOR, "T", vers)

    def exchange(self, now_ns: int) -> None:
        """Request all positions at `now_ns`; waits until `give_up_ns` at most.

        Replies carry no sequence number. Replies received before the request are late
        and dropped. A motor that still owes an earlier reply is given time for two: the
        last one counts.
        """
        self.poller.begin_cycle(now_ns)
        self.arm_ns = self.bus_ns = 0
        self.received = [None] * MOTORS
        try:
            self.counters.stale += self._collect()
            if self._owed:
                self._owed &= self._missing()
            self.received = [None] * MOTORS
            self.bus_ns = 0
            self._link.send(_ARM_ID, self._get_p)
            self.balance.note_question()
            self._asked_ns = now_ns
            self._ask_bus_device()
            self._await_replies(now_ns)
            refused = BusCondition.SOUND
        except LinkFullError:
            refused = BusCondition.FULL
            self.counters.link_errors += 1
        except LinkError:
            refused = BusCondition.DOWN
            self.counters.link_errors += 1
        self._owed = self._missing()
        if not self._owed:
            self.took_ns = self.arm_ns - now_ns
            self._link.errors.confirm()
        self.condition = refused or self._link.errors.condition
        if self._owed:
            for i in range(MOTORS):
                self.counters.missing[i] += self._owed >> i & 1

    def skip(self, now_ns: int) -> tuple[int, int]:
        """Send no position request at `now_ns` and collect stale replies.

        A reply late by whole cycles arrives when a punctual one would, so the wait is
        the duration of the last exchange plus a margin.

        Returns:
            Bits of the motors that answered an earlier request, and the age of the last
            reply [ns], assuming the latest request.
        """
        self.poller.begin_cycle(now_ns)
        self.arm_ns = self.bus_ns = 0
        motors, age_ns = 0, 0
        try:
            self.counters.stale += self._collect()
            self.received = [None] * MOTORS
            self._ask_bus_device()
            settings, clock = self._settings, self._clock
            expected_ns = max(settings.first_read_ns, self.took_ns + _MARGIN_NS)
            deadline_ns = now_ns + min(expected_ns, settings.give_up_ns)
            clock.sleep_until(min(now_ns + settings.first_read_ns, deadline_ns))
            reply_count = self._collect()
            while clock.now_ns() < deadline_ns and clock.wait(self._link, deadline_ns):
                reply_count += self._collect()
            if reply_count:
                motors = (1 << MOTORS) - 1 & ~self._missing()
                age_ns = clock.now_ns() - self._asked_ns
                self.counters.late += reply_count
        except LinkError:
            self.condition = BusCondition.DOWN
            self.counters.link_errors += 1
        self.received = [None] * MOTORS
        self.bus_ns = 0
        return motors, age_ns

    def listen(self, now_ns: int) -> None:
        """Handle received frames without a position request at `now_ns` or waiting."""
        self.poller.begin_cycle(now_ns)
        self.arm_ns = self.bus_ns = 0
        try:
            self.counters.stale += self._collect()
        except LinkError:
            self.condition = BusCondition.DOWN
            self.counters.link_errors += 1
        self.received = [None] * MOTORS

    def take_bus_error(self) -> bool:
        """Return whether the CAN controller reported an error since the last call."""
        frames = self._link.errors.frames
        is_new = frames != self._errors_seen
        self._errors_seen = frames
        return is_new

    def transmit(self, units: list[int]) -> bool:
        """Send torques [puck units]; return False if the bus did not accept a frame.

        None are sent while motors are silent and frames are queued in this host: they
        would be delivered late, as stale torques.
        """
        if self._owed and self._link.has_unsent():
            self.counters.withheld += 1
            return False
        try:
            self._link.send(_LOWER_ID, encode_torques(units[:4], self._t_number))
            self.sent[:4] = units[:4]
            self._link.send(_WRIST_ID, encode_torques(units[4:], self._t_number))
            self.sent[4:] = units[4:]
            self.sent_ns = self._clock.now_ns()
        except LinkError:
            self.counters.link_errors += 1
            return False
        return True

    def ask(self, *, is_urgent: bool = False) -> None:
        """Send the status request that is due in the free bus time."""
        try:
            self.poller.ask(is_urgent=is_urgent)
        except LinkError:
            self.counters.link_errors += 1

    def _ask_bus_device(self) -> None:
        """Poll the other device on the bus; a refused frame does not end the cycle."""
        if self.bus_device is None:
            return
        can_id, data = self.bus_device.poll_frame(self._clock.now_ns())
        try:
            self._link.send(can_id, data)
        except LinkError:
            self.counters.link_errors += 1

    def _await_replies(self, now_ns: int) -> None:
        clock, deadline_ns = self._clock, now_ns + self._settings.give_up_ns
        clock.sleep_until(now_ns + self._settings.first_read_ns)
        arrived = self._collect()
        if arrived:
            self.arm_ns = clock.now_ns()
        while (None in self.received or self._owed) and clock.now_ns() < deadline_ns:
            if not clock.wait(self._link, deadline_ns):
                break
            if new_replies := self._collect():
                arrived += new_replies
                self.arm_ns = clock.now_ns()
        self.counters.stale += arrived - MOTORS + self.received.count(None)

    def _missing(self) -> int:
        """Return the bits of the motors without a reply."""
        if None not in self.received:
            return 0
        return sum(1 << i for i, c in enumerate(self.received) if c is None)

    def _collect(self) -> int:
        """Handle the received frames and return the number of position replies."""
        arrived, received, replies = 0, self.received, self.balance.replies
        for can_id, data, t_ns in self._link.receive():
            index = _POSITION_INDEX.get(can_id)
            try:
                if index is not None:
                    counts = decode_position(data)
                    if received[index] is not None:
                        self._owed &= ~(1 << index)
                    received[index] = counts
                    self.bus_ns = t_ns
                    replies[index] += 1
                    arrived += 1
                else:
                    if self.bus_device is not None:
                        self.bus_device.on_frame(can_id, data)
                    self.poller.on_frame(can_id, data)
            except DeviceFaultError:
                self.counters.malformed += 1
        return arrived
