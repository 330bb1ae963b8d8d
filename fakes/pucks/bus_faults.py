"""Faults of the frames between a simulated network and its host.

No fault occurs by itself: each is switched on, works on the network's time, and lasts
until its count is used up or it is cleared.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from acquisition.clock import PERIOD_NS
from fakes.pucks.event_queue import FRAME_NS, EventQueue
from wam.bus.frames import (
    HOST,
    Group,
    Payload,
    compose_id,
    decode_position,
    encode_position,
    encode_torques,
    group_id,
)

# FROM 31 TO 9 wins every arbitration against pucks, FROM 11 TO group 11 (a reply of a
# hand's finger) loses all of them; no device here uses or receives either.
FOREIGN_IDS = (
    compose_id(31, 9, is_group=False),
    compose_id(11, 11, is_group=True),
)
_FOREIGN_DATA = bytes(range(8))
# Classes and detail of error frames.
_BUS_OFF, _RESTARTED, _PASSIVE = 0x040, 0x100, 0x204
_TX_PASSIVE = bytes((0, 0x20, 0, 0, 0, 0, 130, 0))

Effect = Callable[[bytes], list[tuple[int, bytes]]]  # data -> (delay [ns], data), ...


@dataclass(slots=True)
class _Rule:
    """An effect on the frames of one identifier.

    Attributes:
        effect: gives the frames that replace a frame, and their delays.
        left: remaining strikes, None = until cleared.
        every: strikes every `every`-th frame only.
        share: probability of a strike.
        passed: frames so far.
    """

    effect: Effect
    left: int | None
    every: int
    share: float
    passed: int = 0


class BusFaults:
    """Loses, delays, duplicates and corrupts the frames of a network's devices.

    Traffic between devices is not affected: the faults act on what the host receives,
    `lose_from_host` on what it sends. Frames of one identifier keep their order, as
    they do in the queue of a CAN controller. `count` is how many frames a fault
    strikes, None = all until `clear_faults`.

    Attributes:
        is_down: the host's interface is down: it refuses to send and to receive.
        is_off: the host's controller is bus-off, as Linux shows it: sent frames are
            lost, nothing arrives, and one error frame has reported it.
        is_unacknowledged: no device acknowledges the host's frames; they wait in its
            queue.
        error_frames: (classes, detail) that the host's controller has yet to report.
    """

    def __init__(self, schedule: EventQueue, seed: int = 0) -> None:
        self.is_down = False
        self.is_off = False
        self.is_unacknowledged = False
        self.error_frames: list[tuple[int, bytes]] = []
        self._schedule = schedule
        self._rng = np.random.default_rng(seed)
        self._rules: dict[int, list[_Rule]] = {}
        self._released_ns: dict[int, int] = {}
        self._flood = 0  # number of the present flood; events of earlier ones are void
        self._host_losses: list[Callable[[int, Payload], bool]] = []

    def lose_from_host(self, is_lost: Callable[[int, Payload], bool]) -> None:
        """Lose the host's frames for which `is_lost(identifier, data)` is true.

        It lasts until `clear_faults`.
        """
        self._host_losses.append(is_lost)

    def is_received(self, can_id: int, data: Payload) -> bool:
        """Return whether devices receive a frame of the host."""
        return not any(is_lost(can_id, data) for is_lost in self._host_losses)

    def drop(self, can_id: int, count: int | None = 1, share: float = 1.0) -> None:
        """Drop frames, each with probability `share`."""
        self._add(can_id, lambda _: [], count, share=share)

    def delay(
        self, can_id: int, delay_ns: int, count: int | None = 1, every: int = 1
    ) -> None:
        """Delay every `every`-th frame by `delay_ns`."""
        self._add(can_id, lambda data: [(delay_ns, data)], count, every=every)

    def duplicate(self, can_id: int, count: int | None = 1) -> None:
        """Send frames twice."""
        self._add(can_id, lambda data: [(0, data), (0, data)], count)

    def corrupt(self, can_id: int, byte: int, count: int | None = 1) -> None:
        """Invert one byte, like a memory error that no checksum covers."""

        def invert(data: bytes) -> list[tuple[int, bytes]]:
            corrupted = bytearray(data)
            if byte < len(corrupted):
                corrupted[byte] ^= 0xFF
            return [(0, bytes(corrupted))]

        self._add(can_id, invert, count)

    def answer_twice(
        self, can_id: int, other: Callable[[bytes], bytes], after_ns: int
    ) -> None:
        """Follow every frame with a second one, `other(data)`, `after_ns` later."""
        self._add(can_id, lambda data: [(0, data), (after_ns, other(data))], None)

    def falsify(self, can_id: int, lie: Callable[[int], int]) -> None:
        """Replace every position [counts] that a puck reports by `lie` of it."""

        def replace_position(data: bytes) -> list[tuple[int, bytes]]:
            return [(0, encode_position(lie(decode_position(data))))]

        self._add(can_id, replace_position, None)

    def flood(self, load: float, ids: Sequence[int] = FOREIGN_IDS) -> None:
        """Load the bus with foreign frames: a share `load`, 0 to 1, with `ids` in turn.

        They compete frame by frame; pauses vary by ±50 %, so cycles differ.
        """
        self._flood += 1
        self._send_foreign(self._flood, FRAME_NS[len(_FOREIGN_DATA)] / load, ids)

    def go_off(self) -> None:
        """Put the host's controller in bus-off, as after too many errors."""
        self.is_off = True
        self.error_frames.append((_BUS_OFF, bytes(8)))
        self._intercept_frames()

    def stop_acknowledging(self) -> None:
        """Leave the host's frames unacknowledged, as with a broken cable.

        Its controller turns error-passive and repeats its frame; it never goes bus-off.
        """
        self.is_unacknowledged = True
        self.error_frames.append((_PASSIVE, _TX_PASSIVE))
        self._intercept_frames()

    def go_down(self) -> None:
        """Bring the host's interface down, as `ip link set can0 down` does."""
        self.is_down = True
        self._intercept_frames()

    def report_error(self, classes: int, detail: bytes = bytes(8)) -> None:
        """Make the host's controller report an error frame with `classes`."""
        self.error_frames.append((classes, detail))

    def clear_faults(self) -> None:
        """Clear all faults; frames already delayed still arrive."""
        if self.is_off:
            self.error_frames.append((_RESTARTED, bytes(8)))
        self.is_off = self.is_down = self.is_unacknowledged = False
        self._flood += 1
        self._rules.clear()
        self._host_losses.clear()

    def _add(
        self,
        can_id: int,
        effect: Effect,
        count: int | None,
        *,
        every: int = 1,
        share: float = 1.0,
    ) -> None:
        rule = _Rule(effect, count, every, share)
        self._rules.setdefault(can_id, []).append(rule)
        self._intercept_frames()

    def _intercept_frames(self) -> None:
        """Route the devices' frames through the faults from now on.

        Until the first fault, frames go straight to the wire. The detour stays: after a
        delay has been cleared, frames of one identifier must still keep their order.
        """
        self._schedule.intercept(self._forward)

    def _forward(self, can_id: int, data: bytes) -> None:
        for delay_ns, received in self._apply_rules(can_id, data):
            self._release(can_id, delay_ns, received)

    def _apply_rules(self, can_id: int, data: bytes) -> list[tuple[int, bytes]]:
        """Return the frames that replace a frame, by the first rule that strikes."""
        for rule in self._rules.get(can_id, ()):
            rule.passed += 1
            is_due = rule.left != 0 and rule.passed % rule.every == 0
            if is_due and (rule.share >= 1.0 or self._rng.random() < rule.share):
                if rule.left is not None:
                    rule.left -= 1
                return rule.effect(data)
        return [(0, data)]

    def _release(self, can_id: int, delay_ns: int, data: bytes) -> None:
        now_ns = self._schedule.now_ns
        at_ns = max(now_ns + delay_ns, self._released_ns.get(can_id, 0))
        if at_ns == now_ns:
            self._put(can_id, data)
            return
        self._released_ns[can_id] = at_ns
        self._schedule.after(at_ns - now_ns, lambda: self._put(can_id, data))

    def _put(self, can_id: int, data: bytes) -> None:
        if not (self.is_off or self.is_down or self.is_unacknowledged):
            self._schedule.put(can_id, data)

    def _send_foreign(self, flood: int, gap_ns: float, ids: Sequence[int]) -> None:
        if flood != self._flood:
            return
        self._put(ids[0], _FOREIGN_DATA)
        pause_ns = round(gap_ns * self._rng.uniform(0.5, 1.5))
        following = (*ids[1:], ids[0])
        self._schedule.after(
            pause_ns, lambda: self._send_foreign(flood, gap_ns, following)
        )


_HALF_NS = PERIOD_NS // 2  # it sends between two frames of the arm's own program
_POSITION_REQUEST = b"\x30"
_FRAMES = (
    (Group.ARM, _POSITION_REQUEST),
    (Group.LOWER_TORQUE, encode_torques([0] * 4)),
    (Group.WRIST_TORQUE, encode_torques([0] * 4)),
)

Hear = Callable[[int, int, bytes], None]  # (time [ns], identifier, data)


class OtherMaster:
    """A foreign program that requests positions and sends zero torques at 500 Hz."""

    def __init__(self, schedule: EventQueue, hear: Hear) -> None:
        """Connect to the network: its clock and its `hear` callback for frames."""
        self._schedule = schedule
        self._hear = hear
        self._node = HOST
        self._visit = 0  # number of the present visit; events of earlier ones are void

    def join(self, node: int = HOST) -> None:
        """Start to send as `node`."""
        self._visit += 1
        self._node = node
        visit = self._visit
        self._schedule.after(_HALF_NS, lambda: self._send(visit))

    def leave(self) -> None:
        """Stop sending."""
        self._visit += 1

    def _send(self, visit: int) -> None:
        if visit != self._visit:
            return
        schedule = self._schedule
        for group, data in _FRAMES:
            can_id = group_id(group, self._node)
            schedule.put(can_id, data)
            self._hear(schedule.now_ns, can_id, data)
        schedule.after(PERIOD_NS, lambda: self._send(visit))
