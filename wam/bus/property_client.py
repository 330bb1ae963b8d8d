"""Properties of the devices on the bus, read and set outside the loop."""

from acquisition.clock import Clock
from acquisition.devices import BusCondition
from acquisition.errors import LinkTimeoutError
from wam.bus.frames import (
    HOST,
    FrameError,
    Group,
    decode_reply,
    encode_get,
    encode_set,
    group_id,
    property_reply_id,
)
from wam.bus.link import Frame, Link

_ANSWER_NS = 50_000_000  # a puck answers within 1 ms; a slow adapter adds latency


class PropertyClient:
    """Reads and sets properties of devices outside the loop, one at a time.

    Replies carry no sequence number: each is matched by device and property, and stale
    frames are drained before a request.

    Attributes:
        late_replies: frames so far that matched no open request.
    """

    def __init__(self, link: Link, clock: Clock) -> None:
        self.late_replies = 0
        self._link = link
        self._clock = clock

    @property
    def bus_condition(self) -> BusCondition:
        """Bus condition last reported by the CAN controller."""
        return self._link.errors.condition

    def get(self, node: int, number: int, within_ns: int = _ANSWER_NS) -> int | None:
        """Return the value of property `number` of `node`, None after a timeout.

        Raises:
            LinkError: the bus is down.
        """
        self.drain()
        deadline_ns = self._clock.now_ns() + within_ns
        self._link.send(node, encode_get(number))
        while self._clock.wait(self._link, deadline_ns):
            value = self._find(property_reply_id(node), number)
            if value is not None:
                return value
            if self._clock.now_ns() >= deadline_ns:
                break
        return None

    def require(self, node: int, number: int, name: str) -> int:
        """Return the value of a property; raise if the device does not answer.

        Raises:
            LinkTimeoutError: the device does not answer.
            LinkError: the bus is down.
        """
        value = self.get(node, number)
        if value is None:
            raise LinkTimeoutError(
                f"Node {node} does not answer GET {name} ({number}) within "
                f"{_ANSWER_NS // 1_000_000} ms.",
                hint="Check its cable, the arm's power and the terminators.",
            )
        return value

    def set(self, node: int, number: int, value: int) -> None:
        """Set a property of one device; devices do not acknowledge."""
        self._link.send(node, encode_set(number, value))

    def set_group(self, group: Group, number: int, value: int) -> None:
        """Set a property of all devices of a group."""
        self._link.send(group_id(group, HOST), encode_set(number, value))

    def drain(self) -> None:
        """Discard the frames that are waiting."""
        self.late_replies += len(self._link.receive())

    def pause(self, duration_ns: int) -> None:
        """Wait for `duration_ns`."""
        self._clock.sleep_until(self._clock.now_ns() + duration_ns)

    def _find(self, can_id: int, number: int) -> int | None:
        answer: int | None = None
        for frame in self._link.receive():
            value = _value_of(frame, can_id, number) if answer is None else None
            if value is None:
                self.late_replies += 1
            else:
                answer = value
        return answer


def _value_of(frame: Frame, can_id: int, number: int) -> int | None:
    if frame.can_id != can_id:
        return None
    try:
        reply = decode_reply(frame.data)
    except FrameError:
        return None
    return reply.value if reply.number == number else None
