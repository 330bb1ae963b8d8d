"""Conditions of `--where`: a key, =, !=, <, <=, > or >=, and a number or a word."""

import re
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass

from acquisition.errors import SettingsError
from analysis.data.terrain_kinds import Value

KEYS = (
    "terrain",
    "stones",
    "incline_deg",
    "push_deg",
    "foot",
    "place",
    "kind",
    "session",
    "operator",
)
_CONDITION = re.compile(r"([A-Za-z][A-Za-z0-9_]*)\s*(!=|<=|>=|=|<|>)([^=<>!].*)")
_ORDERED = ("<", "<=", ">", ">=")


@dataclass(frozen=True, slots=True)
class Condition:
    """One condition of `--where`.

    Attributes:
        key: name of the fact.
        sign: =, !=, <, <=, > or >=.
        value: as written; "-" = does not apply.
    """

    key: str
    sign: str
    value: str

    def holds(self, got: Value) -> bool:
        """Return whether `got` meets the condition; words are never ordered."""
        asked, number = _number(self.value), _number(got)
        if asked is not None and number is not None:
            return _compared(number, self.sign, asked)
        if self.sign in _ORDERED:
            return False
        is_same = self.value == ("-" if got is None else str(got))
        return is_same == (self.sign == "=")

    def __str__(self) -> str:
        """Return the condition as typed."""
        return f"{self.key}{self.sign}{self.value}"


@dataclass(frozen=True, slots=True)
class Where:
    """Conditions that all have to hold.

    Attributes:
        conditions: the conditions; none = everything matches.
    """

    conditions: tuple[Condition, ...] = ()

    @property
    def keys(self) -> frozenset[str]:
        """Keys of the conditions."""
        return frozenset(condition.key for condition in self.conditions)

    def matches(self, facts: Mapping[str, Value]) -> bool:
        """Return whether every known fact meets its conditions."""
        return all(c.holds(facts[c.key]) for c in self.conditions if c.key in facts)

    def __bool__(self) -> bool:
        """Whether there are any conditions."""
        return bool(self.conditions)

    def __str__(self) -> str:
        """Return the conditions as typed."""
        return ",".join(map(str, self.conditions))


def parse_where(text: str, factors: Collection[str] = ()) -> Where:
    """Parse conditions such as `K=V,K>=V`.

    Args:
        text: the conditions.
        factors: further keys.

    Raises:
        SettingsError: the text is malformed, a key is unknown, or a word is compared
            by order.
    """
    conditions: list[Condition] = []
    known = [*KEYS, *factors]
    for part in filter(None, text.split(",")):
        match = _CONDITION.fullmatch(part.strip())
        if match is None or match[1] not in known:
            raise SettingsError(
                f"--where {part!r} - expected KEY=VALUE, e.g. kind=live.",
                hint=f"Keys: {', '.join(known)}. Signs: = != < <= > >=.",
            )
        condition = Condition(match[1], match[2], match[3].strip())
        if condition.sign in _ORDERED and _number(condition.value) is None:
            raise SettingsError(
                f"--where {part!r}: {condition.value!r} is no number to compare with.",
                hint="Words are equal or not: = or !=.",
            )
        conditions.append(condition)
    return Where(tuple(conditions))


def check_values(where: Where, known: Iterable[Mapping[str, Value]]) -> None:
    """Refuse a condition on a value that no terrain or session has.

    Args:
        where: the conditions.
        known: facts of all terrains and sessions.

    Raises:
        SettingsError: no fact has the value after = or !=; the message lists the
            known values.
    """
    facts = list(known)
    for condition in where.conditions:
        if condition.sign in _ORDERED:
            continue
        values = {row[condition.key] for row in facts if condition.key in row}
        same = Condition(condition.key, "=", condition.value)
        if any(map(same.holds, values)):
            continue
        names = sorted("-" if value is None else str(value) for value in values)
        raise SettingsError(
            f"--where {condition}: no terrain or session has {condition.key} "
            f"{condition.value!r}.",
            hint=f"There is {', '.join(names[:40]) or 'none yet'}.",
        )


def _number(value: Value) -> float | None:
    if isinstance(value, int | float):
        return float(value)
    try:
        return None if value is None else float(value)
    except ValueError:
        return None


def _compared(number: float, sign: str, asked: float) -> bool:
    results = {
        "=": number == asked,
        "!=": number != asked,
        "<": number < asked,
        "<=": number <= asked,
        ">": number > asked,
        ">=": number >= asked,
    }
    return results[sign]
