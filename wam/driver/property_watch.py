"""Properties of the pucks that decide what a torque is, asked again in turn."""

from collections.abc import Mapping, Sequence
from typing import Final

from acquisition.devices import MotorChange
from wam.bus.frames import MOTOR_NODES, Property
from wam.bus.properties import Device, nearest_documented, property_number

WATCHED: Final = ("IPNM", "MT", "PIDX", "CTS", "VERS")


class PropertyWatch:
    """Asks pucks for what they said at the start, and keeps the first difference.

    Attributes:
        change: the first answer that was another one; None = none was.
    """

    def __init__(self) -> None:
        self.change: MotorChange | None = None
        self._known: dict[tuple[int, int], tuple[str, int]] = {}
        self._questions: list[tuple[int, int]] = []
        self._next = 0

    def begin(
        self, answers: Sequence[Mapping[str, int | None]], firmware: Sequence[int]
    ) -> None:
        """Take what pucks 1 to 7 answered at the start, by name; None = nothing.

        `firmware` of each decides under which number it is asked from now on.
        """
        self.change = None
        self._known.clear()
        for name in WATCHED:
            for node in MOTOR_NODES:
                value = answers[node - 1].get(name)
                if value is not None:
                    known = nearest_documented(firmware[node - 1])
                    number = property_number(Device.MOTOR, name, known)
                    self._known[node, number] = name, value
        self._questions = list(self._known)
        self._next = 0

    def next_question(self) -> tuple[int, int] | None:
        """Return (node, property number), all in turn; None before a start."""
        if not self._questions:
            return None
        question = self._questions[self._next]
        self._next = (self._next + 1) % len(self._questions)
        return question

    def note(self, node: int, reply: Property) -> None:
        """Take the answer of puck `node`; other properties than these are ignored."""
        known = self._known.get((node, reply.number))
        if known is None or reply.value is None or self.change is not None:
            return
        name, was = known
        if reply.value != was:
            self.change = MotorChange(node, name, was, reply.value)
