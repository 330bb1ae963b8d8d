"""Repeated reading of the puck properties that define torque and count units."""

from collections.abc import Mapping, Sequence
from typing import Final

from acquisition.devices import MotorChange
from wam.bus.frames import MOTOR_NODES, Property
from wam.bus.properties import Device, nearest_documented, property_number

WATCHED: Final = ("IPNM", "MT", "PIDX", "CTS", "VERS")


class PropertyWatch:
    """Re-reads properties of the pucks and keeps the first change since the start.

    Attributes:
        change: the first changed property, or None.
    """

    def __init__(self) -> None:
        self.change: MotorChange | None = None
        self._initial: dict[tuple[int, int], tuple[str, int]] = {}
        self._questions: list[tuple[int, int]] = []
        self._next = 0

    def begin(
        self, answers: Sequence[Mapping[str, int | None]], firmware: Sequence[int]
    ) -> None:
        """Store the properties of pucks 1 to 7 at the start, by name; None = unknown.

        `firmware` of each puck determines its property numbers from now on.
        """
        self.change = None
        self._initial.clear()
        for name in WATCHED:
            for node in MOTOR_NODES:
                value = answers[node - 1].get(name)
                if value is not None:
                    documented = nearest_documented(firmware[node - 1])
                    number = property_number(Device.MOTOR, name, documented)
                    self._initial[node, number] = name, value
        self._questions = list(self._initial)
        self._next = 0

    def next_question(self) -> tuple[int, int] | None:
        """Return the next request (node, property number); None before a start."""
        if not self._questions:
            return None
        question = self._questions[self._next]
        self._next = (self._next + 1) % len(self._questions)
        return question

    def note(self, node: int, reply: Property) -> None:
        """Compare a reply of puck `node`; other properties are ignored."""
        entry = self._initial.get((node, reply.number))
        if entry is None or reply.value is None or self.change is not None:
            return
        name, was = entry
        if reply.value != was:
            self.change = MotorChange(node, name, was, reply.value)
