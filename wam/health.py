"""How the motor pucks feel: temperatures, bus voltage and last error."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

from wam.frames import MOTOR_NODES, Property
from wam.pucks import Device, property_number


@dataclass(frozen=True, slots=True)
class PuckHealth:
    """What one puck said last; None = it never answered.

    Attributes:
        puck_degc: temperature of the puck (TEMP) [degrees Celsius].
        motor_degc: temperature of its motor (THERM) [degrees Celsius].
        bus_voltage: voltage of the power bus (VBUS) [V].
        error: its last error (ERROR), 0 = none.
    """

    puck_degc: int | None = None
    motor_degc: int | None = None
    bus_voltage: int | None = None
    error: int | None = None


# The numbers up to 41 are the same in every firmware that can be driven.
_FIELDS: Final = {
    property_number(Device.MOTOR, name): field
    for name, field in (
        ("TEMP", "puck_degc"),
        ("THERM", "motor_degc"),
        ("VBUS", "bus_voltage"),
        ("ERROR", "error"),
    )
}
_QUESTIONS = tuple((node, number) for number in _FIELDS for node in MOTOR_NODES)


def ask_health(ask: Callable[[int], int | None]) -> PuckHealth:
    """Return what a puck says when `ask(number)` puts each question to it."""
    answers = {field: ask(number) for number, field in _FIELDS.items()}
    return PuckHealth(**answers)


class HealthTable:
    """The newest answers of all pucks, and the question that comes next.

    Attributes:
        pucks: health of pucks 1 to 7.
    """

    def __init__(self) -> None:
        self.pucks: list[PuckHealth] = [PuckHealth() for _ in MOTOR_NODES]
        self._next = 0

    def next_question(self) -> tuple[int, int]:
        """Return (node, property number); all 28 come in turn."""
        question = _QUESTIONS[self._next]
        self._next = (self._next + 1) % len(_QUESTIONS)
        return question

    def note(self, node: int, reply: Property) -> None:
        """Take the answer of puck `node`; other properties than these are ignored."""
        field = _FIELDS.get(reply.number)
        if field is not None:
            old = self.pucks[node - 1]
            self.pucks[node - 1] = replace(old, **{field: reply.value})


def temperature_range(pucks: Sequence[PuckHealth]) -> str:
    """Return the coldest and hottest of pucks and motors, such as "31-36 °C"."""
    found = [t for p in pucks for t in (p.puck_degc, p.motor_degc) if t is not None]
    return f"{min(found)}-{max(found)} °C" if found else "temperatures unknown"


def health_facts(pucks: Sequence[PuckHealth]) -> dict[str, str]:
    """Return the answers as text for a recording, pucks 1 to 7 in each line."""

    def row(values: Sequence[int | None]) -> str:
        return " ".join("?" if value is None else str(value) for value in values)

    return {
        "pucks:temperature_degc": row([p.puck_degc for p in pucks]),
        "pucks:motor_temperature_degc": row([p.motor_degc for p in pucks]),
        "pucks:bus_voltage": row([p.bus_voltage for p in pucks]),
        "pucks:error": row([p.error for p in pucks]),
    }
