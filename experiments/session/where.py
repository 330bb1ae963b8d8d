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
    """One of them.

    Attributes:
        key: what is asked for.
        sign: =, !=, <, <=, > or >=.
        value: as written; "-" = does not apply.
    """

    key: str
    sign: str
    value: str

    def holds(self, got: Value) -> bool:
        """Return whether a value is as asked; what has no order is never below."""
        asked, number = _number(self.value), _number(got)
        if asked is not None and number is not None:
            return _compared(number, self.sign, asked)
        if self.sign in _ORDERED:
            return False
        is_same = self.value == ("-" if got is None else str(got))
        return is_same == (self.sign == "=")

    def __str__(self) -> str:
        """Return it as a person writes it."""
        return f"{self.key}{self.sign}{self.value}"


@dataclass(frozen=True, slots=True)
class Where:
    """All conditions that have to hold.

    Attributes:
        conditions: none = everything is asked for.
    """

    conditions: tuple[Condition, ...] = ()

    @property
    def keys(self) -> frozenset[str]:
        """What is asked for."""
        return frozenset(condition.key for condition in self.conditions)

    def matches(self, facts: Mapping[str, Value]) -> bool:
        """Return whether every fact that is asked for, and is known, is as asked."""
        return all(c.holds(facts[c.key]) for c in self.conditions if c.key in facts)

    def __bool__(self) -> bool:
        """Whether anything is asked for."""
        return bool(self.conditions)

    def __str__(self) -> str:
        """Return the conditions as a person writes them."""
        return ",".join(map(str, self.conditions))


def parse_where(text: str, factors: Collection[str] = ()) -> Where:
    """Return the conditions in `K=V,K>=V`.

    Args:
        text: the conditions.
        factors: keys beside `KEYS`.

    Raises:
        SettingsError: it is not of that form, a key is unknown, or an order is asked
            for of something that is no number.
    """
    conditions: list[Condition] = []
    known = [*KEYS, *factors]
    for part in filter(None, text.split(",")):
        found = _CONDITION.fullmatch(part.strip())
        if found is None or found[1] not in known:
            raise SettingsError(
                f"--where {part!r} - expected KEY=VALUE, e.g. kind=live.",
                hint=f"Keys: {', '.join(known)}. Signs: = != < <= > >=.",
            )
        condition = Condition(found[1], found[2], found[3].strip())
        if condition.sign in _ORDERED and _number(condition.value) is None:
            raise SettingsError(
                f"--where {part!r}: {condition.value!r} is no number to compare with.",
                hint="Words are equal or not: = or !=.",
            )
        conditions.append(condition)
    return Where(tuple(conditions))


def check_values(where: Where, known: Iterable[Mapping[str, Value]]) -> None:
    """Refuse a condition on a value that nothing has: it would match nothing.

    Args:
        where: the conditions.
        known: facts of the terrains and sessions that there are.

    Raises:
        SettingsError: no fact has the value that = or != names; the known ones are
            named.
    """
    facts = list(known)
    for condition in where.conditions:
        if condition.sign in _ORDERED:
            continue
        values = {each[condition.key] for each in facts if condition.key in each}
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
