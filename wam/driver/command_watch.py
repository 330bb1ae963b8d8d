"""Whether the pucks do as they are told: mode and torque, asked for in turn.

Torque frames are not acknowledged, and a puck that has left torque mode goes on telling
its position. So each is asked what it holds, and the answer compared with what was
sent.
"""

from collections import deque
from collections.abc import Sequence
from typing import Final

from acquisition.devices import MotorChange
from wam.bus.frames import MOTOR_NODES, Property
from wam.bus.properties import Device, PuckMode, nearest_documented, property_number

_MODE: Final = 8  # the same in every firmware
# A puck that misses a single frame, or answers before the newest, is in order.
_RECENT: Final = 4  # torque frames
_NEVER: Final = 2**31
_TRIES: Final = 5  # a suspicion that is answered no more is dropped


class CommandWatch:
    """Asks for MODE and T of pucks 1 to 7 in turn, and judges what they answer.

    A first contradiction is a suspicion only: the pucks of an arm that the pendant has
    just idled, or activated, hold something else than the host believes. The same
    question is put again once the safety module has said that it is active still.

    Attributes:
        is_suspicious: the module is to be asked for its mode, then the puck again.
    """

    def __init__(self) -> None:
        self.is_suspicious = False
        self._suspect_ns = 0
        self._tries = 0
        self._next = 0
        self._sent: deque[Sequence[int]] = deque(maxlen=_RECENT)
        self._limits: Sequence[int] = [_NEVER] * len(MOTOR_NODES)
        self._questions: list[tuple[int, int]] = []

    def begin(self, limits: Sequence[int | None], firmware: Sequence[int]) -> None:
        """Begin after a start: nothing is sent yet.

        Args:
            limits: the most that each puck makes, MT [puck units]; None = not known.
            firmware: of each puck; it decides under which number it is asked for T.
        """
        self.is_suspicious = False
        self._next = 0
        self._sent.clear()
        self._limits = [_NEVER if limit is None else limit for limit in limits]
        self._questions = [
            question
            for node, vers in zip(MOTOR_NODES, firmware, strict=True)
            for question in ((node, _MODE), (node, _t_number(vers)))
        ]

    def note_sent(self, units: Sequence[int]) -> None:
        """Take the torques of a cycle as the bus took them [puck units], seven."""
        self._sent.append(tuple(units))

    def forget(self) -> None:
        """Expect nothing any more: the arm is idle, or not asked to be driven."""
        self.is_suspicious = False
        self._sent.clear()

    def question(self) -> tuple[int, int] | None:
        """Return (node, property number) to ask for; None while nothing is sent."""
        if not self._sent or not self._questions:
            return None
        if self.is_suspicious and self._tries < _TRIES:
            self._tries += 1
        else:
            self.is_suspicious = False
            self._next = (self._next + 1) % len(self._questions)
        return self._questions[self._next]

    def judge(
        self, node: int, reply: Property, now_ns: int, active_ns: int
    ) -> MotorChange | None:
        """Return how puck `node` contradicts what it was told; None = not proved.

        Args:
            node: its number.
            reply: what it answered; other properties than these are ignored.
            now_ns: time of this cycle [ns].
            active_ns: when the module last said that it is active [ns].
        """
        if not self._sent or not self._questions or reply.value is None:
            return None
        asked = self._questions[self._next]
        if (node, reply.number) != asked:
            return None
        difference = self._difference(node, reply)
        if difference is None:
            self.is_suspicious = False
            return None
        if not self.is_suspicious:
            self.is_suspicious = True
            self._suspect_ns = now_ns
            self._tries = 0
            return None
        return difference if active_ns > self._suspect_ns else None

    def is_to_be_confirmed(self, active_ns: int) -> bool:
        """Return whether the module has still to say that it is active."""
        return self.is_suspicious and active_ns <= self._suspect_ns

    def _difference(self, node: int, reply: Property) -> MotorChange | None:
        value = reply.value
        assert value is not None
        if reply.number == _MODE:
            if value == PuckMode.TORQUE:
                return None
            return MotorChange(node, "MODE", PuckMode.TORQUE, value)
        most = self._limits[node - 1]
        held = [max(-most, min(units[node - 1], most)) for units in self._sent]
        return None if value in held else MotorChange(node, "T", held[-1], value)


def _t_number(vers: int) -> int:
    return property_number(Device.MOTOR, "T", nearest_documented(vers))
