"""Check of the pucks' properties against a table of expected values.

CTS and IPNM define the units of counts and torques, and a driver has to trust them;
PIDX, MT and the groups determine which torque a puck applies, without any feedback. So
all are compared with a table: the shipped one, or the known values of this arm.
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

_ALIKE: Final = 0.02  # largest relative difference of the motors of a differential
# Properties without effect on torques and counts.
_ADVISORY: Final = frozenset({"OTEMP", "VBUS"})
_MOST_HINTS: Final = 3


class Expectation(TomlTable):
    """Expected values of one property of the seven pucks.

    Attributes:
        values: nominal values.
        low: lower limits; None = `values`.
        high: upper limits; None = `values`.
        others: alternative rows of seven values.
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
        """Lower limits."""
        return self.values if self.low is None else self.low

    @property
    def highest(self) -> _Seven:
        """Upper limits."""
        return self.values if self.high is None else self.high

    def bounds(self, found: Values) -> list[tuple[int, int]]:
        """Return (lower, upper) limits of each puck, of the best matching row."""
        rows = [list(zip(self.lowest, self.highest, strict=True))]
        rows += [[(value, value) for value in other] for other in self.others]
        return max(rows, key=lambda row: _matches(row, found))


def _matches(row: Sequence[tuple[int, int]], found: Values) -> int:
    return sum(
        value is not None and low <= value <= high
        for value, (low, high) in zip(found, row, strict=True)
    )


class PuckTable(TomlTable):
    """Expected properties by name; missing ones are not compared."""

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
        """Return the table with its rows replaced by those of `own`."""
        return self.model_copy(update=own.rows())


@lru_cache(maxsize=1)
def shipped_table() -> PuckTable:
    """Return the table of a WAM as delivered."""
    return PuckTable.parse((resources.files("wam.data") / "pucks.toml").read_text())


def known_table(text: str, name: str) -> PuckTable:
    """Return the shipped table with the rows of one arm from the file `name`.

    Raises:
        SettingsError: `text` is not such a table.
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
    """Read the properties of a puck with firmware `vers` through `ask(number)`.

    Returns:
        Values by name; None = no reply. Properties unknown to the firmware are left
        out.
    """
    table = numbers(Device.MOTOR, nearest_documented(vers))
    return {name: ask(table[name]) for name in ASKED if name in table}


@dataclass(frozen=True, slots=True)
class Difference:
    """An unexpected property value.

    Attributes:
        node: puck number, 1 to 7.
        name: name of the property.
        value: value reported by the puck.
        expected: expected value as text.
        wanted: value to set; None = only the motor's label has it.
        is_warning: the arm can be driven despite it.
    """

    node: int
    name: str
    value: int
    expected: str
    wanted: int | None = None
    is_warning: bool = False

    @property
    def text(self) -> str:
        """The difference as text."""
        return (
            f"{self.name} of puck {self.node} is {self.value}, expected {self.expected}"
        )

    def frames(self, vers: int) -> str:
        """Return the frames that set and save the value, "" if it is not documented."""
        if self.wanted is None:
            return ""
        documented = nearest_documented(vers)
        number = property_number(Device.MOTOR, self.name, documented)
        save = property_number(Device.MOTOR, "SAVE", documented)
        payloads = encode_set(number, self.wanted), encode_set(save, number)
        return " ".join(f"{self.node:03X}#{data.hex().upper()}" for data in payloads)


def compare(table: PuckTable, found: Mapping[str, Values]) -> list[Difference]:
    """Return the differences of the pucks from a table; unknown values are skipped."""
    differences: list[Difference] = []
    for name, row in table.rows().items():
        if name in found:
            out_of_range = _out_of_range(name, row, found[name])
            differences += out_of_range or _unequal_pairs(name, row, found[name])
    return differences


def _out_of_range(name: str, row: Expectation, found: Values) -> list[Difference]:
    differences: list[Difference] = []
    bounds = row.bounds(found)
    for i, (value, (low, high)) in enumerate(zip(found, bounds, strict=True)):
        if value is None or low <= value <= high:
            continue
        # Too high an MT is acceptable: the host limits the torque, too.
        is_acceptable = name in _ADVISORY or (name == "MT" and value > high)
        is_exact = low == high
        expected = str(low) if is_exact else f"{low} to {high}"
        wanted = low if is_exact else row.values[i] if name == "MT" else None
        differences.append(
            Difference(i + 1, name, value, expected, wanted, is_acceptable)
        )
    return differences


def _unequal_pairs(name: str, row: Expectation, found: Values) -> list[Difference]:
    differences: list[Difference] = []
    for first, second in row.alike:
        a, b = found[first - 1], found[second - 1]
        if a is not None and b is not None and abs(a - b) > _ALIKE * max(a, b):
            expected = f"within 2 % of the {a} of puck {first}"
            differences.append(Difference(second, name, b, expected))
    return differences


def refuse(differences: Sequence[Difference], firmware: Sequence[int]) -> None:
    """Refuse an arm with differences that are not warnings, naming all of them.

    Args:
        differences: result of `compare`.
        firmware: firmware of pucks 1 to 7.

    Raises:
        UnfitDeviceError: there is a difference that is not a warning.
    """
    severe = [d for d in differences if not d.is_warning]
    if not severe:
        return
    remedies = [frames for d in severe if (frames := d.frames(firmware[d.node - 1]))]
    if len(remedies) > _MOST_HINTS:
        remedies = [*remedies[:_MOST_HINTS], "and so on"]
    remedy = (
        f" To set and keep it, the arm idle: {', '.join(remedies)}." if remedies else ""
    )
    raise UnfitDeviceError(
        f"{'; '.join(d.text for d in severe)}.",
        hint="Is this the arm and the puck it should be?"
        + remedy
        + " If a puck is right "
        "as it is, write its value into the file that [arm] properties of rig.toml "
        "names.",
    )
