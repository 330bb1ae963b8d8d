"""What the pucks call their properties: numbers by device, firmware and name.

The numbers moved with the firmware, so no driver may know one by heart: it reads VERS
and asks here. The tables are in `puck_tables`.
"""

from enum import Enum, IntEnum
from functools import cache

from acquisition import SettingsError
from wam.bus.property_tables import COMMON, MOTOR, SAFETY, SENSOR, WIDE

MODERN = 61  # from here on motor and safety firmware have tables of their own
FIRST_RELEASED = 32
OLDEST_DRIVEN = 65  # from here on all that the driver asks a motor for has its place
POLES_OF_WRIST = 6
POLES_OF_GIMBALS = 8
MAGNETIC_ENCODER = 0x0100


class Device(Enum):
    """Kinds of tables a device can follow."""

    MOTOR = "motor puck"
    SAFETY = "safety module"
    SENSOR = "force/torque sensor"
    MONITOR = "sleeping puck"


class PuckRole(IntEnum):
    """The low five bits of ROLE."""

    TATER = 0
    GIMBALS = 1
    SAFETY = 2
    WRAPTOR = 3
    TRIGGER = 4
    BHAND = 5
    FORCE = 6


class PuckStatus(IntEnum):
    """Values of STAT."""

    RESET = 0
    ERROR = 1
    READY = 2


class PuckMode(IntEnum):
    """Values of MODE on a motor puck; the arm uses IDLE and TORQUE only."""

    IDLE = 0
    DUTY = 1
    TORQUE = 2
    PID = 3
    VELOCITY = 4
    TRAPEZOIDAL = 5


def device_of(role: int, stat: int = PuckStatus.READY) -> Device | None:
    """Return the table a device follows, None for a role no driver knows."""
    if stat == PuckStatus.RESET:
        return Device.MONITOR
    kinds = {
        PuckRole.TATER: Device.MOTOR,
        PuckRole.WRAPTOR: Device.MOTOR,
        PuckRole.BHAND: Device.MOTOR,
        PuckRole.SAFETY: Device.SAFETY,
        PuckRole.FORCE: Device.SENSOR,
    }
    return kinds.get(role & 0x1F)  # pyright: ignore[reportArgumentType, reportCallIssue]


def property_number(device: Device, name: str, vers: int = MODERN) -> int:
    """Return the number of property `name` on `device` with firmware `vers`.

    Raises:
        SettingsError: that firmware does not have the property.
    """
    number = numbers(device, vers).get(name)
    if number is None:
        raise SettingsError(
            f"A {device.value} with firmware {vers} has no property {name}.",
            hint="Is the firmware older or newer than this program knows?",
        )
    return number


@cache
def numbers(device: Device, vers: int = MODERN) -> dict[str, int]:
    """Return every property of `device` with firmware `vers` and its number."""
    common = dict(COMMON)
    if device is Device.MONITOR:
        return common | {"LOCK": 8, "SAVE": 9, "LOAD": 10}
    if device is Device.SENSOR:
        return common | _shared(_at(MOTOR, MODERN)) | SENSOR
    if vers < FIRST_RELEASED:
        return common
    motor = _at(MOTOR, vers)
    if device is Device.MOTOR:
        return motor
    inherited = motor if vers < MODERN else _shared(motor)
    return inherited | _at(SAFETY, vers)


@cache
def names(device: Device, vers: int = MODERN) -> dict[int, str]:
    """Return the names of `numbers` by number, the first where two share one."""
    table: dict[int, str] = {}
    for name, number in numbers(device, vers).items():
        table.setdefault(number, name)
    return table


def is_wide(name: str) -> bool:
    """Return whether a property is answered with 32 bits instead of 16."""
    return name in WIDE


def _shared(motor: dict[str, int]) -> dict[str, int]:
    """Return the properties of modern motor firmware that every device has."""
    return {name: number for name, number in motor.items() if number <= 41}


def _at(table: str, vers: int) -> dict[str, int]:
    """Return the numbers that hold for firmware `vers`."""
    numbers_by_name: dict[str, int] = {}
    for line in table.splitlines():
        name, *entries = line.split()
        for number, first in (entry.split("@") for entry in entries):
            if int(first) <= vers:
                numbers_by_name.pop(name, None)
                if number != "-":
                    numbers_by_name[name] = int(number)
    return numbers_by_name
