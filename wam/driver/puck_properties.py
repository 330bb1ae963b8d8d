"""What motor pucks must say of themselves, and where they say otherwise.

A driver that reads CTS and IPNM takes the puck's word for what a count and a torque
mean; PIDX, MT and the groups decide what becomes of a torque without being heard at
all. So they are held against a table: the one shipped, or what this arm is known to be.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib import resources
from typing import Final, Self

from pydantic import ConfigDict, Field, model_validator

from acquisition.errors import SettingsError, UnfitDeviceError
from acquisition.settings import Whole
from acquisition.toml_files import TomlTable
from wam.bus.frames import MOTOR_NODES, encode_set
from wam.bus.properties import (
    Device,
    nearest_documented,
    numbers,
    property_number,
)

_Seven = tuple[Whole, Whole, Whole, Whole, Whole, Whole, Whole]
Values = Sequence[int | None]  # of one property, motors 1 to 7; None = not known

_ALIKE: Final = 0.02  # by which the motors of one differential may differ
# No torque and no count depends on these.
_ADVISORY: Final = frozenset({"OTEMP", "VBUS"})
_MOST_HINTS: Final = 3


class Expectation(TomlTable):
    """What the seven pucks should have of one property.

    Attributes:
        values: as they should be.
        low: the least that passes; None = `values`.
        high: the most that passes; None = `values`.
        others: rows that may stand in the place of `values`, all seven of them.
        alike: pairs of motors whose values differ by 2 % at most.
    """

    model_config = ConfigDict(extra="forbid")

    values: _Seven
    low: _Seven | None = None
    high: _Seven | None = None
    others: tuple[_Seven, ...] = ()
    alike: tuple[tuple[Whole, Whole], ...] = ()

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        rows = zip(self.lowest, self.values, self.highest, strict=True)
        if any(not low <= value <= high for low, value, high in rows):
            raise ValueError("low, values and high are not in order")
        if any(m not in MOTOR_NODES for pair in self.alike for m in pair):
            raise ValueError("motors that are alike are 1 to 7")
        return self

    @property
    def lowest(self) -> _Seven:
        """The least that passes."""
        return self.values if self.low is None else self.low

    @property
    def highest(self) -> _Seven:
        """The most that passes."""
        return self.values if self.high is None else self.high

    def bounds(self, found: Values) -> list[tuple[int, int]]:
        """Return between what each puck should be, in the row that fits most."""
        rows = [list(zip(self.lowest, self.highest, strict=True))]
        rows += [[(value, value) for value in other] for other in self.others]
        return max(rows, key=lambda row: _passing(row, found))


def _passing(row: Sequence[tuple[int, int]], found: Values) -> int:
    return sum(
        value is not None and low <= value <= high
        for value, (low, high) in zip(found, row, strict=True)
    )


class PuckTable(TomlTable):
    """Expected properties by their names; those that are left out are not compared."""

    model_config = ConfigDict(extra="forbid")

    ID: Expectation | None = Field(default=None, description="node id")
    ROLE: Expectation | None = Field(default=None, description="kind and options")
    SN: Expectation | None = Field(default=None, description="serial number")
    VERS: Expectation | None = Field(default=None, description="firmware")
    CTS: Expectation | None = Field(default=None, description="counts per turn")
    PIDX: Expectation | None = Field(default=None, description="slot of its torque")
    GRPA: Expectation | None = Field(default=None, description="group")
    GRPB: Expectation | None = Field(default=None, description="group")
    GRPC: Expectation | None = Field(default=None, description="group")
    IPNM: Expectation | None = Field(default=None, description="units per N m")
    POLES: Expectation | None = Field(default=None, description="poles of the motor")
    MT: Expectation | None = Field(default=None, description="largest torque, units")
    OTEMP: Expectation | None = Field(default=None, description="too hot, °C")
    VBUS: Expectation | None = Field(default=None, description="bus voltage, V")

    def rows(self) -> dict[str, Expectation]:
        """Return the expectations by name."""
        return {
            name: row
            for name, row in vars(self).items()
            if isinstance(row, Expectation)
        }

    def overridden(self, own: "PuckTable") -> "PuckTable":
        """Return the table with what `own` says in the place of its own rows."""
        return self.model_copy(update=own.rows())


@lru_cache(maxsize=1)
def shipped_table() -> PuckTable:
    """Return what a WAM is as it left the factory."""
    return PuckTable.parse((resources.files("wam.data") / "pucks.toml").read_text())


def known_table(text: str, name: str) -> PuckTable:
    """Return the shipped table with what the file `name` says of one arm.

    Raises:
        SettingsError: `text` is no such table.
    """
    try:
        return shipped_table().overridden(PuckTable.parse(text))
    except ValueError as error:
        raise SettingsError(
            f"{name} is no table of puck properties: {error}.",
            hint="Correct it, or take the line properties out of [arm] of rig.toml. "
            "Nothing was started.",
        ) from error


ASKED: Final = ("ID", "SN", "PIDX", "GRPA", "GRPB", "GRPC", "POLES", "MT", "OTEMP")


def ask_properties(
    ask: Callable[[int], int | None], vers: int
) -> dict[str, int | None]:
    """Return what a puck with firmware `vers` answers to `ask(number)`, by name.

    None = it is silent; what its firmware does not have is left out.
    """
    table = numbers(Device.MOTOR, nearest_documented(vers))
    return {name: ask(table[name]) for name in ASKED if name in table}


@dataclass(frozen=True, slots=True)
class Difference:
    """A property that is not as expected.

    Attributes:
        node: puck number, 1 to 7.
        name: of the property.
        value: as the puck has it.
        expected: in words.
        wanted: what it should be set to; None = only this motor's label tells.
        is_warning: the arm can be driven all the same.
    """

    node: int
    name: str
    value: int
    expected: str
    wanted: int | None = None
    is_warning: bool = False

    @property
    def text(self) -> str:
        """Return it in words."""
        return (
            f"{self.name} of puck {self.node} is {self.value}, expected {self.expected}"
        )

    def frames(self, vers: int) -> str:
        """Return which frames set and save it, "" where nothing can be told."""
        if self.wanted is None:
            return ""
        known = nearest_documented(vers)
        number = property_number(Device.MOTOR, self.name, known)
        save = property_number(Device.MOTOR, "SAVE", known)
        words = encode_set(number, self.wanted), encode_set(save, number)
        return " ".join(f"{self.node:03X}#{data.hex().upper()}" for data in words)


def compare(table: PuckTable, found: Mapping[str, Values]) -> list[Difference]:
    """Return where pucks differ from a table; what is not known does not differ."""
    differences: list[Difference] = []
    for name, row in table.rows().items():
        if name in found:
            beyond = _beyond(name, row, found[name])
            differences += beyond or _unlike(name, row, found[name])
    return differences


def _beyond(name: str, row: Expectation, found: Values) -> list[Difference]:
    differences: list[Difference] = []
    bounds = row.bounds(found)
    for i, (value, (low, high)) in enumerate(zip(found, bounds, strict=True)):
        if value is None or low <= value <= high:
            continue
        # A puck that would make more than it should is bounded by the host.
        is_bearable = name in _ADVISORY or (name == "MT" and value > high)
        is_one = low == high
        expected = str(low) if is_one else f"{low} to {high}"
        wanted = low if is_one else row.values[i] if name == "MT" else None
        differences.append(
            Difference(i + 1, name, value, expected, wanted, is_bearable)
        )
    return differences


def _unlike(name: str, row: Expectation, found: Values) -> list[Difference]:
    differences: list[Difference] = []
    for one, other in row.alike:
        a, b = found[one - 1], found[other - 1]
        if a is not None and b is not None and abs(a - b) > _ALIKE * max(a, b):
            expected = f"within 2 % of the {a} of puck {one}"
            differences.append(Difference(other, name, b, expected))
    return differences


def refuse(differences: Sequence[Difference], firmware: Sequence[int]) -> None:
    """Tell together what keeps the arm from being driven.

    Args:
        differences: as `compare` gives them; warnings do not count.
        firmware: of pucks 1 to 7.

    Raises:
        UnfitDeviceError: there is such a difference.
    """
    severe = [d for d in differences if not d.is_warning]
    if not severe:
        return
    ways = [frames for d in severe if (frames := d.frames(firmware[d.node - 1]))]
    if len(ways) > _MOST_HINTS:
        ways = [*ways[:_MOST_HINTS], "and so on"]
    how = f" To set and keep it, the arm idle: {', '.join(ways)}." if ways else ""
    raise UnfitDeviceError(
        f"{'; '.join(d.text for d in severe)}.",
        hint="Is this the arm and the puck it should be?" + how + " If a puck is right "
        "as it is, write its value into the file that [arm] properties of rig.toml "
        "names.",
    )
