"""The time of a simulated network: what happens later, and what has been said."""

from collections.abc import Callable
from heapq import heappop, heappush

from wam.frames import encode_reply, property_reply_id
from wam.pucks import is_wide

OutFrame = tuple[int, int, bytes]  # ready for the wire at [ns], identifier, data

# One bit is 1 us at 1 Mbit/s: 47 bits of frame and 8 per byte, with the stuff bits
# that typical content needs.
FRAME_NS = tuple(1000 * bits for bits in (50, 58, 67, 76, 84, 93, 101, 110, 118))


class Schedule:
    """One time for all devices of a network, their plans and their frames.

    Attributes:
        now_ns: the network's time; it never runs back.
        on_emit: what a device's frame meets on its way to the wire.
    """

    def __init__(self, t_ns: int) -> None:
        self.now_ns = t_ns
        self.on_emit: Callable[[int, bytes], None] = self.put
        self._plans: list[tuple[int, int, Callable[[], None]]] = []
        self._plan_count = 0
        self._outbox: list[OutFrame] = []

    def go_to(self, t_ns: int) -> None:
        """Let it be `t_ns`, if it is not later already."""
        self.now_ns = max(t_ns, self.now_ns)

    def after(self, delay_ns: int, action: Callable[[], None]) -> None:
        """Plan `action` for `delay_ns` from now."""
        self._plan_count += 1  # keeps plans for one instant in their order
        heappush(self._plans, (self.now_ns + delay_ns, self._plan_count, action))

    def next_ns(self) -> int | None:
        """Return when the next plan is due, None if there is none."""
        return self._plans[0][0] if self._plans else None

    def run_due(self) -> bool:
        """Carry out one plan that is due; return False if none is."""
        if not self._plans or self._plans[0][0] > self.now_ns:
            return False
        heappop(self._plans)[2]()
        return True

    def emit(self, can_id: int, data: bytes) -> None:
        """Let a device say something now; `on_emit` decides what becomes of it."""
        self.on_emit(can_id, data)

    def put(self, can_id: int, data: bytes) -> None:
        """Hand a frame to the wire now."""
        self._outbox.append((self.now_ns, can_id, data))

    def reply(self, node: int, number: int, name: str, value: int) -> None:
        """Answer a GET of property `name`, which has `number` on this device."""
        is_long = is_wide(name)
        if not is_long:
            value = (value + 0x8000) % 0x10000 - 0x8000  # a host may set any number
        self.emit(property_reply_id(node), encode_reply(number, value, is_wide=is_long))

    def take(self) -> list[OutFrame]:
        """Return the frames handed to the wire since the last call."""
        frames, self._outbox = self._outbox, []
        return frames
