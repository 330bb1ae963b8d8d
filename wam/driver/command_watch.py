"""Verification of commands: reads back mode and torque of each puck in turn.

Torque frames are not acknowledged, and a puck that has left torque mode still reports
its position. Each puck is therefore asked for MODE and T, and the values are compared
with those sent.
"""

from collections import deque
from collections.abc import Sequence
from typing import Final

from acquisition.devices import MotorChange
from wam.bus.frames import MOTOR_NODES, Property
from wam.bus.properties import Device, PuckMode, nearest_documented, property_number

_MODE: Final = 8  # the same in every firmware
# T may match any of the recent frames: one may be lost, or sent after the request.
_RECENT: Final = 4  # torque frames
_UNLIMITED: Final = 2**31
_TRIES: Final = 5  # requests without a reply until a suspicion is dropped


class CommandWatch:
    """Reads MODE and T of pucks 1 to 7 in turn and compares them with the commands.

    A first mismatch is only a suspicion, because the pendant may just have idled or
    activated the arm. The request is repeated after the safety module has confirmed
    that it is still active.

    Attributes:
        is_suspicious: a mismatch awaits confirmation by the module and a second read.
    """

    def __init__(self) -> None:
        self.is_suspicious = False
        self._suspect_ns = 0
        self._tries = 0
        self._next = 0
        self._sent: deque[Sequence[int]] = deque(maxlen=_RECENT)
        self._limits: Sequence[int] = [_UNLIMITED] * len(MOTOR_NODES)
        self._questions: list[tuple[int, int]] = []

    def begin(self, limits: Sequence[int | None], firmware: Sequence[int]) -> None:
        """Reset after a start.

        Args:
            limits: torque limit MT of each puck [puck units]; None = not known.
            firmware: firmware of each puck, which determines the number of T.
        """
        self.is_suspicious = False
        self._next = 0
        self._sent.clear()
        self._limits = [_UNLIMITED if limit is None else limit for limit in limits]
        self._questions = [
            question
            for node, vers in zip(MOTOR_NODES, firmware, strict=True)
            for question in ((node, _MODE), (node, _t_number(vers)))
        ]

    def note_sent(self, units: Sequence[int]) -> None:
        """Record the torques sent in a cycle [puck units], seven."""
        self._sent.append(tuple(units))

    def forget(self) -> None:
        """Stop checking: the arm is idle or not commanded."""
        self.is_suspicious = False
        self._sent.clear()

    def question(self) -> tuple[int, int] | None:
        """Return the next request (node, property number); None before any torque."""
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
        """Return the confirmed mismatch of puck `node` with its command, or None.

        Args:
            node: puck number.
            reply: its reply; other properties than MODE and T are ignored.
            now_ns: time of this cycle [ns].
            active_ns: time of the module's last report of ACTIVE [ns].
        """
        if not self._sent or not self._questions or reply.value is None:
            return None
        expected = self._questions[self._next]
        if (node, reply.number) != expected:
            return None
        mismatch = self._mismatch(node, reply)
        if mismatch is None:
            self.is_suspicious = False
            return None
        if not self.is_suspicious:
            self.is_suspicious = True
            self._suspect_ns = now_ns
            self._tries = 0
            return None
        return mismatch if active_ns > self._suspect_ns else None

    def is_to_be_confirmed(self, active_ns: int) -> bool:
        """Return whether a suspicion awaits the module's report of ACTIVE."""
        return self.is_suspicious and active_ns <= self._suspect_ns

    def _mismatch(self, node: int, reply: Property) -> MotorChange | None:
        value = reply.value
        assert value is not None
        if reply.number == _MODE:
            if value == PuckMode.TORQUE:
                return None
            return MotorChange(node, "MODE", PuckMode.TORQUE, value)
        limit = self._limits[node - 1]
        expected = [max(-limit, min(units[node - 1], limit)) for units in self._sent]
        return (
            None if value in expected else MotorChange(node, "T", expected[-1], value)
        )


def _t_number(vers: int) -> int:
    return property_number(Device.MOTOR, "T", nearest_documented(vers))
