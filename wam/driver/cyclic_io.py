"""The frames of one cycle: positions asked for, torques sent, devices watched.

Time-outs follow the measured budget of one 2 ms cycle on a 1 Mbit/s bus.
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
_MARGIN_NS = 200_000  # by which two exchanges differ
_POSITION_INDEX: Final = {position_reply_id(n): n - 1 for n in MOTOR_NODES}


@dataclass(slots=True)
class LinkCounters:
    """What the loop dropped on its way, counted instead of logged.

    Attributes:
        missing: questions for its position that each of motors 1 to 7 left open.
        stale: position replies that came after their cycle, or twice.
        late: position replies that came when none was asked for, after their cycle was
            taken for complete.
        rejected: positions that jumped.
        malformed: frames that contradict the protocol.
        link_errors: times the bus refused.
        withheld: torques not sent because earlier frames had not left.
        link: the bus, which says what its transport is and what was lost there.
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
        """Return the counters as text for a recording, motors 1 to 7 in one line."""
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
    """A device that is asked along with the positions, such as a wrist sensor.

    The loop never waits for it: its frames are heard when they have come, in this cycle
    or in a later one.
    """

    def poll_frame(self, t_ns: int) -> tuple[int, bytes]:
        """Return identifier and bytes of the question that leaves at `t_ns`."""
        ...

    def on_frame(self, can_id: int, data: Payload) -> None:
        """Take a frame that is no position, of whatever device; never raises."""
        ...


class CycleTraffic:
    """What host and arm say to each other while the loop runs; never raises.

    Attributes:
        received: positions of this cycle [counts], motors 1 to 7, None = no reply.
        arm_ns: when the last of them arrived [ns], 0 = none did.
        bus_ns: when the bus had the last of them [ns], 0 = it does not tell.
        sent: torques that the bus took last [puck units], motors 1 to 7.
        sent_ns: when it took them [ns], 0 = never.
        poller: safety module and pucks, asked in the free bus time.
        bus_device: asked right after the positions, while the pucks latch theirs.
        counters: what was dropped so far.
        balance: of position replies and the questions for them.
        condition: what became of the bus at the last question for positions.
        took_ns: from the last question to the last reply that was awaited [ns].
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
        self._asked_ns = 0  # when positions were asked for last
        self._errors_seen = 0  # error frames
        self._owed = 0  # bit i set = motor i+1 may still answer an earlier question
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
        """Ask for all positions at `now_ns`; waits until `give_up_ns` at most.

        Replies carry no number. What has come by now is late and thrown away. A motor
        that owes an earlier answer is given the time to send two: the last one counts.
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
        """Ask for no position at `now_ns`; return what comes all the same.

        A reply that is late by whole cycles comes when its cycle's own would: the bus
        is listened to for as long as the last exchange took, and a little more.

        Returns:
            Bits of the motors that answer an earlier question, and the age of the last
            of these answers [ns] if it is of the last question.
        """
        self.poller.begin_cycle(now_ns)
        self.arm_ns = self.bus_ns = 0
        motors, age_ns = 0, 0
        try:
            self.counters.stale += self._collect()
            self.received = [None] * MOTORS
            self._ask_bus_device()
            settings, clock = self._settings, self._clock
            usual_ns = max(settings.first_look_ns, self.took_ns + _MARGIN_NS)
            deadline_ns = now_ns + min(usual_ns, settings.give_up_ns)
            clock.sleep_until(min(now_ns + settings.first_look_ns, deadline_ns))
            came = self._collect()
            while clock.now_ns() < deadline_ns and clock.wait(self._link, deadline_ns):
                came += self._collect()
            if came:
                motors = (1 << MOTORS) - 1 & ~self._missing()
                age_ns = clock.now_ns() - self._asked_ns
                self.counters.late += came
        except LinkError:
            self.condition = BusCondition.DOWN
            self.counters.link_errors += 1
        self.received = [None] * MOTORS
        self.bus_ns = 0
        return motors, age_ns

    def listen(self, now_ns: int) -> None:
        """Take what is not a position; ask for none at `now_ns`, and do not wait."""
        self.poller.begin_cycle(now_ns)
        self.arm_ns = self.bus_ns = 0
        try:
            self.counters.stale += self._collect()
        except LinkError:
            self.condition = BusCondition.DOWN
            self.counters.link_errors += 1
        self.received = [None] * MOTORS

    def take_bus_error(self) -> bool:
        """Return whether the controller reported an error since the last time."""
        frames = self._link.errors.frames
        is_new = frames != self._errors_seen
        self._errors_seen = frames
        return is_new

    def transmit(self, units: list[int]) -> bool:
        """Send torques [puck units]; return False when the bus did not take a frame.

        While motors are silent and frames still wait in this host, a torque would wait
        too and act when it is stale: none is sent then.
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
        """Ask the status question that is due in the free bus time."""
        try:
            self.poller.ask(is_urgent=is_urgent)
        except LinkError:
            self.counters.link_errors += 1

    def _ask_bus_device(self) -> None:
        """Ask the other device on the bus; a refusal does not cost the positions."""
        if self.bus_device is None:
            return
        can_id, data = self.bus_device.poll_frame(self._clock.now_ns())
        try:
            self._link.send(can_id, data)
        except LinkError:
            self.counters.link_errors += 1

    def _await_replies(self, now_ns: int) -> None:
        clock, deadline_ns = self._clock, now_ns + self._settings.give_up_ns
        clock.sleep_until(now_ns + self._settings.first_look_ns)
        arrived = self._collect()
        if arrived:
            self.arm_ns = clock.now_ns()
        while (None in self.received or self._owed) and clock.now_ns() < deadline_ns:
            if not clock.wait(self._link, deadline_ns):
                break
            if more := self._collect():
                arrived += more
                self.arm_ns = clock.now_ns()
        self.counters.stale += arrived - MOTORS + self.received.count(None)

    def _missing(self) -> int:
        """Return the bits of the motors whose reply has not come."""
        if None not in self.received:
            return 0
        return sum(1 << i for i, c in enumerate(self.received) if c is None)

    def _collect(self) -> int:
        """Sort what has arrived and return how many positions there were."""
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
