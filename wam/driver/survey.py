"""Survey of the arm's bus for commissioning: traffic at rest, replies per request."""

from dataclasses import dataclass, field

from acquisition.clock import Clock
from wam.bus.frames import (
    MOTOR_NODES,
    SAFETY_NODE,
    FrameError,
    decode_reply,
    encode_get,
    property_reply_id,
)
from wam.bus.link import Link
from wam.bus.properties import COMMON

_WINDOW_NS = 5_000_000  # all replies to a request arrive within it


@dataclass(frozen=True, slots=True)
class RestTraffic:
    """Traffic on the bus without requests.

    Attributes:
        frames: device frames.
        master: identifier of the first frame of another bus master so far, or None.
        error_frames: error frames of the CAN controller so far.
    """

    frames: int
    master: int | None
    error_frames: int


@dataclass(frozen=True, slots=True)
class ReplyCounts:
    """Number of replies of each device to one request.

    Attributes:
        nodes: requested devices.
        counts: largest number of replies to one request, per device.
        differing: devices that gave different replies to one request.
    """

    nodes: list[int] = field(default_factory=list[int])
    counts: list[int] = field(default_factory=list[int])
    differing: list[int] = field(default_factory=list[int])


class BusSurvey:
    """Counts frames and replies on the bus, outside the loop."""

    def __init__(self, link: Link, clock: Clock) -> None:
        self._link = link
        self._clock = clock

    def listen(self, duration_ns: int) -> RestTraffic:
        """Listen for `duration_ns` without requests and return the traffic.

        Raises:
            LinkError: the bus is down.
        """
        link, clock = self._link, self._clock
        deadline_ns = clock.now_ns() + duration_ns
        frames = len(link.receive())
        while clock.now_ns() < deadline_ns:
            clock.wait(link, deadline_ns)
            frames += len(link.receive())
        return RestTraffic(frames, link.foreign_id, link.errors.frames)

    def count_answers(self, times: int) -> ReplyCounts:
        """Request STAT of every device of the arm `times` times; count the replies.

        Raises:
            LinkError: the bus is down.
        """
        answers = ReplyCounts()
        for node in (*MOTOR_NODES, SAFETY_NODE):
            values = [self._replies_of(node) for _ in range(times)]
            answers.nodes.append(node)
            answers.counts.append(max(map(len, values)))
            if any(len(set(replies)) > 1 for replies in values):
                answers.differing.append(node)
        return answers

    def _replies_of(self, node: int) -> list[int]:
        link, clock, number = self._link, self._clock, COMMON["STAT"]
        link.receive()
        deadline_ns = clock.now_ns() + _WINDOW_NS
        link.send(node, encode_get(number))
        values: list[int] = []
        while clock.now_ns() < deadline_ns:
            clock.wait(link, deadline_ns)
            for frame in link.receive():
                if frame.can_id != property_reply_id(node):
                    continue
                try:
                    reply_number, value = decode_reply(frame.data)
                except FrameError:
                    continue
                if reply_number == number and value is not None:
                    values.append(value)
        return values
