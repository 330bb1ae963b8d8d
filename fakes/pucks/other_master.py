"""Another program that drives the same arm: it asks for positions and sends torques."""

from collections.abc import Callable

from acquisition import PERIOD_NS
from fakes.pucks.event_queue import EventQueue
from wam.bus import Group, encode_torques, group_id

_HALF_NS = PERIOD_NS // 2  # it speaks between two frames of the arm's own program
_ASK = b"\x30"  # for the position
_FRAMES = (
    (group_id(Group.ARM), _ASK),
    (group_id(Group.LOWER_TORQUE), encode_torques([0] * 4)),
    (group_id(Group.WRIST_TORQUE), encode_torques([0] * 4)),
)

Hear = Callable[[int, int, bytes], None]  # (time [ns], identifier, data)


class OtherMaster:
    """Sends zero torques 500 times a second while it is on the bus."""

    def __init__(self, schedule: EventQueue, hear: Hear) -> None:
        """Take the network's time and what the devices hear with."""
        self._schedule = schedule
        self._hear = hear
        self._visit = 0  # number of the present one; events of earlier ones are void

    def join(self) -> None:
        """Begin to send."""
        self._visit += 1
        visit = self._visit
        self._schedule.after(_HALF_NS, lambda: self._send(visit))

    def leave(self) -> None:
        """Send nothing any more."""
        self._visit += 1

    def _send(self, visit: int) -> None:
        if visit != self._visit:
            return
        schedule = self._schedule
        for can_id, data in _FRAMES:
            schedule.put(can_id, data)
            self._hear(schedule.now_ns, can_id, data)
        schedule.after(PERIOD_NS, lambda: self._send(visit))
