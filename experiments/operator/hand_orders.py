"""Orders to the hands at a served arm, one per line, e.g. pose, hang, push."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from acquisition.simulation import Hands

_HARDEST = 4.0  # N m, largest torque of a twisting hand
_LONGEST, _HEAVIEST, _STRONGEST, _FARTHEST = 600.0, 20.0, 200.0, 7.0  # s, kg, N, rad


@dataclass(frozen=True, slots=True)
class PoseOrder:
    """Bring the joints to `q` [rad], seven, in `seconds`."""

    q: tuple[float, ...]
    seconds: float

    def give(self, hands: Hands) -> None:
        """Let the hands do it."""
        hands.pose(self.q, self.seconds)


@dataclass(frozen=True, slots=True)
class StopOrder:
    """Turn `joint`, 1-7, onto its stop on one side."""

    joint: int
    side: Literal["low", "high"]

    def give(self, hands: Hands) -> None:
        """Let the hands do it."""
        hands.turn_to_stop(self.joint, self.side)


@dataclass(frozen=True, slots=True)
class HangOrder:
    """Hang `mass` [kg] from the sole; 0 takes it off."""

    mass: float

    def give(self, hands: Hands) -> None:
        """Let the hands do it."""
        hands.hang(self.mass)


@dataclass(frozen=True, slots=True)
class PushOrder:
    """Push the sole with `force` [N], three, base frame, for `seconds`."""

    force: tuple[float, ...]
    seconds: float

    def give(self, hands: Hands) -> None:
        """Let the hands do it."""
        hands.push_with(self.force, self.seconds)


@dataclass(frozen=True, slots=True)
class TwistOrder:
    """Twist the foot about joint 7 with `torque` [N m] for `seconds`."""

    torque: float
    seconds: float

    def give(self, hands: Hands) -> None:
        """Let the hands do it."""
        hands.twist(self.torque, self.seconds)


@dataclass(frozen=True, slots=True)
class ReleaseOrder:
    """Let go of the arm."""

    def give(self, hands: Hands) -> None:
        """Let the hands do it."""
        hands.let_go()


HandOrder = PoseOrder | StopOrder | HangOrder | PushOrder | TwistOrder | ReleaseOrder


class HandOrderError(ValueError):
    """A malformed command to the hands; its text states the reason."""


def parse_hand_order(words: list[str]) -> HandOrder | None:
    """Parse an order; None if its first word is no order to the hands.

    Raises:
        HandOrderError: an argument is missing, superfluous or out of range.
    """
    reader = _READERS.get(words[0].lower()) if words else None
    return None if reader is None else reader(words[1:])


def _pose(words: list[str]) -> HandOrder:
    *angles, seconds = _numbers(words, 8, "pose q1 q2 q3 q4 q5 q6 q7 SECONDS")
    return PoseOrder(
        tuple(_within(angle, -_FARTHEST, _FARTHEST, "rad") for angle in angles),
        _within(seconds, 0.1, _LONGEST, "s"),
    )


def _stop(words: list[str]) -> HandOrder:
    usage = "stop JOINT low|high"
    if len(words) != 2 or words[0] not in ["1", "2", "3", "4", "5", "6", "7"]:
        raise HandOrderError(f"- expected {usage}, a joint 1..7")
    side = words[1].lower()
    if side == "low" or side == "high":  # noqa: PLR1714 - narrows the type
        return StopOrder(int(words[0]), side)
    raise HandOrderError(f"- expected {usage}")


def _hang(words: list[str]) -> HandOrder:
    (mass,) = _numbers(words, 1, "hang KG")
    return HangOrder(_within(mass, 0.0, _HEAVIEST, "kg"))


def _unhang(words: list[str]) -> HandOrder:
    _numbers(words, 0, "unhang")
    return HangOrder(0.0)


def _push(words: list[str]) -> HandOrder:
    *force, seconds = _numbers(words, 4, "push FX FY FZ SECONDS")
    return PushOrder(
        tuple(_within(axis, -_STRONGEST, _STRONGEST, "N") for axis in force),
        _within(seconds, 0.0, _LONGEST, "s"),
    )


def _twist(words: list[str]) -> HandOrder:
    torque, seconds = _numbers(words, 2, "twist N_M SECONDS")
    return TwistOrder(
        _within(torque, -_HARDEST, _HARDEST, "N m"),
        _within(seconds, 0.0, _LONGEST, "s"),
    )


def _release(words: list[str]) -> HandOrder:
    _numbers(words, 0, "release")
    return ReleaseOrder()


_READERS: dict[str, Callable[[list[str]], HandOrder]] = {
    "pose": _pose,
    "stop": _stop,
    "hang": _hang,
    "unhang": _unhang,
    "push": _push,
    "twist": _twist,
    "release": _release,
}
HAND_WORDS = tuple(_READERS)


def _numbers(words: list[str], count: int, usage: str) -> list[float]:
    """Return `count` numbers, or raise HandOrderError."""
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        numbers = []
    if len(words) != count or len(numbers) != count:
        raise HandOrderError(f"- expected {usage}")
    return numbers


def _within(value: float, least: float, most: float, unit: str) -> float:
    """Return `value` if it is from `least` to `most`, or raise HandOrderError."""
    if not (math.isfinite(value) and least <= value <= most):
        raise HandOrderError(f"- {value:g} is not within {least:g}..{most:g} {unit}")
    return value
