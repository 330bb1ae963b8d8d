"""The clock of a simulated network, its planned events and the frames sent."""

from collections.abc import Callable
from heapq import heappop, heappush

from wam.bus.frames import encode_reply, property_reply_id
from wam.bus.properties import is_wide

OutFrame = tuple[int, int, bytes]  # ready for the wire at [ns], identifier, data

NEVER = 1 << 63  # later than any time [ns]

# One bit is 1 us at 1 Mbit/s: 47 bits of frame and 8 per byte, with the stuff bits
# that typical content needs.
FRAME_NS = tuple(1000 * bits for bits in (50, 58, 67, 76, 84, 93, 101, 110, 118))


class EventQueue:
    """One clock for all devices of a network, their planned events and frames.

    The wire reads the time of the next event with every frame, so it is cached.

    Attributes:
        now_ns: the network's time; never decreases.
        next_ns: when the next event or the alarm is due, `NEVER` if there is none.
        emit: sends a frame of a device now (identifier, data); see `intercept`.
        outbox: frames ready for the wire, until `take`.
    """

    def __init__(self, t_ns: int) -> None:
        self.now_ns = t_ns
        self.next_ns = NEVER
        self.emit: Callable[[int, bytes], None] = self.put
        self._on_alarm: Callable[[], None] = lambda: None
        self._alarm_ns = NEVER
        self._events: list[tuple[int, int, Callable[[], None]]] = []
        self._event_count = 0
        self.outbox: list[OutFrame] = []

    def after(self, delay_ns: int, action: Callable[[], None]) -> None:
        """Schedule `action` in `delay_ns` from now."""
        self._event_count += 1  # keeps events of one instant in their order
        at_ns = self.now_ns + delay_ns
        heappush(self._events, (at_ns, self._event_count, action))
        self.next_ns = min(self.next_ns, at_ns)

    def intercept(self, emit: Callable[[int, bytes], None]) -> None:
        """Pass every frame of a device to `emit` from now on, instead of `put`."""
        self.emit = emit

    def define_alarm(self, action: Callable[[], None]) -> None:
        """Set the action of the alarm."""
        self._on_alarm = action

    def set_alarm(self, at_ns: int) -> None:
        """Set the time of the alarm, replacing the last one; `NEVER` = off."""
        self._alarm_ns = at_ns
        self._find_next()

    def advance(self, t_ns: int) -> None:
        """Run all events due until `t_ns` in order of time; `now_ns` is then `t_ns`."""
        while (next_ns := self.next_ns) <= t_ns:
            self.now_ns = max(self.now_ns, next_ns)
            # At one instant events come first: they may postpone the alarm.
            if self._events and self._events[0][0] <= self.now_ns:
                action = heappop(self._events)[2]
                self._find_next()
                action()
            else:
                self._on_alarm()
        self.now_ns = t_ns if t_ns > self.now_ns else self.now_ns

    def put(self, can_id: int, data: bytes) -> None:
        """Pass a frame to the wire now."""
        self.outbox.append((self.now_ns, can_id, data))

    def reply(self, node: int, number: int, name: str, value: int) -> None:
        """Answer a GET of property `name`, which has `number` on this device."""
        is_long = is_wide(name)
        if not is_long:
            value = (value + 0x8000) % 0x10000 - 0x8000  # a host may set any number
        self.emit(property_reply_id(node), encode_reply(number, value, is_wide=is_long))

    def take(self) -> list[OutFrame]:
        """Return the frames handed to the wire since the last call."""
        frames, self.outbox = self.outbox, []
        return frames

    def _find_next(self) -> None:
        events, alarm_ns = self._events, self._alarm_ns
        self.next_ns = events[0][0] if events and events[0][0] < alarm_ns else alarm_ns
