"""Who says what on the arm's bus, counted: for an arm that is not known yet."""

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

_WINDOW_NS = 5_000_000  # in which every answer to one question has come


@dataclass(frozen=True, slots=True)
class Heard:
    """What came while nothing was asked.

    Attributes:
        frames: of devices.
        master: identifier of the first frame of another host so far; None = none came.
        error_frames: that the bus's controller has reported so far.
    """

    frames: int
    master: int | None
    error_frames: int


@dataclass(frozen=True, slots=True)
class Answers:
    """How often each device answers one question.

    Attributes:
        nodes: devices that were asked.
        counts: answers to one question, the most of some.
        differing: of these devices, those that gave two different answers.
    """

    nodes: list[int] = field(default_factory=list[int])
    counts: list[int] = field(default_factory=list[int])
    differing: list[int] = field(default_factory=list[int])


class BusSurvey:
    """Counts what is on a bus, outside the loop."""

    def __init__(self, link: Link, clock: Clock) -> None:
        self._link = link
        self._clock = clock

    def listen(self, duration_ns: int) -> Heard:
        """Ask for nothing for so long and return what was heard.

        Raises:
            LinkError: the bus is down.
        """
        link, clock = self._link, self._clock
        deadline_ns = clock.now_ns() + duration_ns
        frames = len(link.receive())
        while clock.now_ns() < deadline_ns:
            clock.wait(link, deadline_ns)
            frames += len(link.receive())
        return Heard(frames, link.foreign_id, link.errors.frames)

    def count_answers(self, times: int) -> Answers:
        """Ask every device of the arm for its status `times` times; count the answers.

        Raises:
            LinkError: the bus is down.
        """
        answers = Answers()
        for node in (*MOTOR_NODES, SAFETY_NODE):
            values = [self._answers_of(node) for _ in range(times)]
            answers.nodes.append(node)
            answers.counts.append(max(map(len, values)))
            if any(len(set(given)) > 1 for given in values):
                answers.differing.append(node)
        return answers

    def _answers_of(self, node: int) -> list[int]:
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
                    found, value = decode_reply(frame.data)
                except FrameError:
                    continue
                if found == number and value is not None:
                    values.append(value)
        return values
