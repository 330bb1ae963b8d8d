"""What can go wrong with frames between a simulated network and its host.

Nothing happens here of its own accord: a fault is switched on, works on the network's
time, and goes on until its count is used up or it is mended.
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

# FROM 31 TO 9 wins every arbitration against pucks, FROM 11 TO group 11 (what the
# finger of a hand says) loses all of them; nobody here has or hears either.
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
        effect: what is left of a frame, and how much later.
        left: how often it still strikes, None = until mended.
        every: it strikes every so many frames.
        share: it strikes with this probability.
        passed: frames so far.
    """

    effect: Effect
    left: int | None
    every: int
    share: float
    passed: int = 0


class BusFaults:
    """Loses, delays, doubles and spoils the frames of a network's devices.

    Devices among themselves are not touched: the faults sit before the host, and
    `lose_from_host` behind it. Frames of one identifier keep their order, as they do in
    the queue of a CAN controller. `count` is how many frames a fault strikes, None =
    all until `clear_faults`.

    Attributes:
        is_down: the host's interface is down: it refuses to send and to receive.
        is_off: the host's controller has left the bus, as Linux shows it: what is sent
            vanishes, nothing arrives, and one error frame told it.
        is_unheard: nobody acknowledges what the host sends: it waits in its queue.
        error_frames: (classes, detail) that the host's controller has still to tell.
    """

    def __init__(self, schedule: EventQueue, seed: int = 0) -> None:
        self.is_down = False
        self.is_off = False
        self.is_unheard = False
        self.error_frames: list[tuple[int, bytes]] = []
        self._schedule = schedule
        self._rng = np.random.default_rng(seed)
        self._rules: dict[int, list[_Rule]] = {}
        self._released_ns: dict[int, int] = {}
        self._flood = 0  # number of the present one; events of earlier ones are void
        self._unheard: list[Callable[[int, Payload], bool]] = []

    def lose_from_host(self, is_lost: Callable[[int, Payload], bool]) -> None:
        """Let no device hear the host's frames for which `is_lost(identifier, data)`.

        It lasts until `clear_faults`.
        """
        self._unheard.append(is_lost)

    def is_heard(self, can_id: int, data: Payload) -> bool:
        """Return whether devices hear a frame of the host."""
        return not any(is_lost(can_id, data) for is_lost in self._unheard)

    def drop(self, can_id: int, count: int | None = 1, share: float = 1.0) -> None:
        """Lose frames, each with probability `share`."""
        self._add(can_id, lambda _: [], count, share=share)

    def delay(
        self, can_id: int, delay_ns: int, count: int | None = 1, every: int = 1
    ) -> None:
        """Let every so-many-th frame reach the wire `delay_ns` later."""
        self._add(can_id, lambda data: [(delay_ns, data)], count, every=every)

    def duplicate(self, can_id: int, count: int | None = 1) -> None:
        """Let frames come twice."""
        self._add(can_id, lambda data: [(0, data), (0, data)], count)

    def corrupt(self, can_id: int, byte: int, count: int | None = 1) -> None:
        """Invert one byte, as a failing memory does that no checksum covers."""

        def spoil(data: bytes) -> list[tuple[int, bytes]]:
            spoilt = bytearray(data)
            if byte < len(spoilt):
                spoilt[byte] ^= 0xFF
            return [(0, bytes(spoilt))]

        self._add(can_id, spoil, count)

    def answer_twice(
        self, can_id: int, other: Callable[[bytes], bytes], after_ns: int
    ) -> None:
        """Let every frame be followed by `other` of it, `after_ns` later."""
        self._add(can_id, lambda data: [(0, data), (after_ns, other(data))], None)

    def falsify(self, can_id: int, lie: Callable[[int], int]) -> None:
        """Let `lie` change every position [counts] that a puck tells."""

        def tell(data: bytes) -> list[tuple[int, bytes]]:
            return [(0, encode_position(lie(decode_position(data))))]

        self._add(can_id, tell, None)

    def flood(self, load: float, ids: Sequence[int] = FOREIGN_IDS) -> None:
        """Let others use `load` of the bus, 0 to 1, with `ids` in turn.

        They compete frame by frame; pauses vary by half, so no cycle is like another.
        """
        self._flood += 1
        self._say_foreign(self._flood, FRAME_NS[len(_FOREIGN_DATA)] / load, ids)

    def go_off(self) -> None:
        """Let the host's controller leave the bus, as after too many errors."""
        self.is_off = True
        self.error_frames.append((_BUS_OFF, bytes(8)))
        self._step_in()

    def go_unheard(self) -> None:
        """Leave the host alone on the bus, as behind a torn cable.

        Its controller becomes passive and repeats its frame for ever; it never leaves.
        """
        self.is_unheard = True
        self.error_frames.append((_PASSIVE, _TX_PASSIVE))
        self._step_in()

    def go_down(self) -> None:
        """Set the host's interface down, as `ip link set can0 down` does."""
        self.is_down = True
        self._step_in()

    def report_error(self, classes: int, detail: bytes = bytes(8)) -> None:
        """Let the host's controller tell an error frame with `classes`."""
        self.error_frames.append((classes, detail))

    def clear_faults(self) -> None:
        """End everything; frames that are late already still come."""
        if self.is_off:
            self.error_frames.append((_RESTARTED, bytes(8)))
        self.is_off = self.is_down = self.is_unheard = False
        self._flood += 1
        self._rules.clear()
        self._unheard.clear()

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
        self._step_in()

    def _step_in(self) -> None:
        """Come between devices and wire, once and for good.

        Until something goes wrong for the first time frames take the short way. The
        long one stays: a mended delay still keeps frames of an identifier in order.
        """
        self._schedule.intercept(self._pass_on)

    def _pass_on(self, can_id: int, data: bytes) -> None:
        for delay_ns, left in self._struck(can_id, data):
            self._release(can_id, delay_ns, left)

    def _struck(self, can_id: int, data: bytes) -> list[tuple[int, bytes]]:
        """Return what the first rule that strikes leaves of a frame."""
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
        if not (self.is_off or self.is_down or self.is_unheard):
            self._schedule.put(can_id, data)

    def _say_foreign(self, flood: int, gap_ns: float, ids: Sequence[int]) -> None:
        if flood != self._flood:
            return
        self._put(ids[0], _FOREIGN_DATA)
        pause_ns = round(gap_ns * self._rng.uniform(0.5, 1.5))
        following = (*ids[1:], ids[0])
        self._schedule.after(
            pause_ns, lambda: self._say_foreign(flood, gap_ns, following)
        )


_HALF_NS = PERIOD_NS // 2  # it speaks between two frames of the arm's own program
_ASK = b"\x30"  # for the position
_FRAMES = (
    (Group.ARM, _ASK),
    (Group.LOWER_TORQUE, encode_torques([0] * 4)),
    (Group.WRIST_TORQUE, encode_torques([0] * 4)),
)

Hear = Callable[[int, int, bytes], None]  # (time [ns], identifier, data)


class OtherMaster:
    """Asks for positions 500 times a second while it is on the bus, and sends torques.

    Those are zero.
    """

    def __init__(self, schedule: EventQueue, hear: Hear) -> None:
        """Take the network's time and what the devices hear with."""
        self._schedule = schedule
        self._hear = hear
        self._node = HOST
        self._visit = 0  # number of the present one; events of earlier ones are void

    def join(self, node: int = HOST) -> None:
        """Begin to send as `node`."""
        self._visit += 1
        self._node = node
        visit = self._visit
        self._schedule.after(_HALF_NS, lambda: self._send(visit))

    def leave(self) -> None:
        """Send nothing any more."""
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
