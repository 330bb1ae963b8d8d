"""Puck telemetry: temperatures, bus voltage, last error, and age of the report."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Final

from acquisition.clock import NS_PER_S
from wam.bus.frames import MOTOR_NODES, Property
from wam.bus.properties import MODERN, Device, nearest_documented, property_number

# Each puck is polled every 0.7 s; a report is stale after four requests without reply.
STALE_NS = 3 * NS_PER_S
HOT = 60  # over-temperature limit of a puck, default of OTEMP [degrees Celsius]


@dataclass(frozen=True, slots=True)
class PuckHealth:
    """Newest telemetry of one puck; None = never reported.

    Attributes:
        puck_degc: temperature of the puck (TEMP) [degrees Celsius].
        motor_degc: temperature of its motor (THERM) [degrees Celsius].
        bus_voltage: voltage of the power bus (VBUS) [V].
        error: its last error (ERROR), 0 = none.
        heard_ns: monotonic time of the last report [ns].
    """

    puck_degc: int | None = None
    motor_degc: int | None = None
    bus_voltage: int | None = None
    error: int | None = None
    heard_ns: int | None = None

    def is_recent(self, now_ns: int) -> bool:
        """Return whether the last report is recent."""
        return self.heard_ns is not None and now_ns - self.heard_ns <= STALE_NS


_FIELDS: Final = {
    "TEMP": "puck_degc",
    "THERM": "motor_degc",
    "VBUS": "bus_voltage",
    "ERROR": "error",
}
_QUESTIONS = tuple((node, name) for name in _FIELDS for node in MOTOR_NODES)


@cache
def _numbers(vers: int) -> dict[str, int]:
    """Return the numbers of the telemetry properties, by name."""
    firmware = nearest_documented(vers)
    return {name: property_number(Device.MOTOR, name, firmware) for name in _FIELDS}


def ask_health(ask: Callable[[int], int | None], vers: int) -> PuckHealth:
    """Read the telemetry of a puck with firmware `vers` through `ask(number)`.

    `heard_ns` is left to the caller: see `HealthTable.begin`.
    """
    answers = {_FIELDS[name]: ask(number) for name, number in _numbers(vers).items()}
    return PuckHealth(**answers)


class HealthTable:
    """Newest telemetry of all pucks and the order of polling.

    Attributes:
        pucks: telemetry of pucks 1 to 7.
    """

    def __init__(self) -> None:
        self.pucks: list[PuckHealth] = [PuckHealth() for _ in MOTOR_NODES]
        self._next = 0
        self._set_firmware([MODERN] * len(MOTOR_NODES))

    def _set_firmware(self, firmware: Sequence[int]) -> None:
        """Use the property numbers of the firmware of pucks 1 to 7."""
        tables = [_numbers(vers) for vers in firmware]
        self._questions = [(node, tables[node - 1][name]) for node, name in _QUESTIONS]
        self._fields = [
            {number: _FIELDS[name] for name, number in table.items()}
            for table in tables
        ]

    def next_question(self) -> tuple[int, int]:
        """Return the next request (node, property number), 28 in rotation."""
        question = self._questions[self._next]
        self._next = (self._next + 1) % len(self._questions)
        return question

    def begin(
        self, pucks: Sequence[PuckHealth], firmware: Sequence[int], now_ns: int
    ) -> None:
        """Set the telemetry of pucks 1 to 7 read at start-up, at `now_ns`.

        `firmware` of each puck determines its property numbers from now on.
        """
        self._set_firmware(firmware)
        self.pucks[:] = [
            replace(puck, heard_ns=now_ns if puck != PuckHealth() else None)
            for puck in pucks
        ]

    def note(self, node: int, reply: Property, now_ns: int) -> None:
        """Store a telemetry reply of puck `node`; other properties are ignored."""
        field = self._fields[node - 1].get(reply.number)
        if field is not None:
            previous = self.pucks[node - 1]
            self.pucks[node - 1] = replace(
                previous, heard_ns=now_ns, **{field: reply.value}
            )


def temperature_range(pucks: Sequence[PuckHealth], now_ns: int) -> str:
    """Return the temperature range of pucks and motors, such as "31-36 °C".

    Pucks with a stale report are excluded and named with its age.
    """
    temperatures = [
        degc
        for puck in pucks
        for degc in (puck.puck_degc, puck.motor_degc)
        if degc is not None and puck.is_recent(now_ns)
    ]
    range_text = (
        f"{min(temperatures)}-{max(temperatures)} °C"
        if temperatures
        else "temperatures unknown"
    )
    silent = [
        f"puck {node} silent for {(now_ns - puck.heard_ns) / NS_PER_S:.0f} s"
        for node, puck in enumerate(pucks, 1)
        if puck.heard_ns is not None and not puck.is_recent(now_ns)
    ]
    return ", ".join([range_text, *silent])


def health_warnings(pucks: Sequence[PuckHealth], now_ns: int) -> list[str]:
    """Return warnings of pucks 1 to 7, such as "puck 3 at 72 °C (limit 60)"."""
    texts: list[str] = []
    for node, puck in enumerate(pucks, 1):
        if not puck.is_recent(now_ns):
            continue
        if puck.puck_degc is not None and puck.puck_degc > HOT:
            texts.append(f"puck {node} at {puck.puck_degc} °C (limit {HOT})")
        if puck.error:
            texts.append(f"puck {node} reports error {puck.error}")
    return texts


def health_metadata(pucks: Sequence[PuckHealth], now_ns: int) -> dict[str, str]:
    """Return the telemetry as metadata of a recording, pucks 1 to 7 in each line.

    "?" = never reported or stale; ages [s] are those of the last report.
    """
    ages = [
        "?" if p.heard_ns is None else f"{(now_ns - p.heard_ns) / NS_PER_S:.1f}"
        for p in pucks
    ]
    pucks = [p if p.is_recent(now_ns) else PuckHealth() for p in pucks]

    def row(values: Sequence[int | None]) -> str:
        return " ".join("?" if value is None else str(value) for value in values)

    return {
        "pucks:age_s": " ".join(ages),
        "pucks:temperature_degc": row([p.puck_degc for p in pucks]),
        "pucks:motor_temperature_degc": row([p.motor_degc for p in pucks]),
        "pucks:bus_voltage": row([p.bus_voltage for p in pucks]),
        "pucks:error": row([p.error for p in pucks]),
    }
