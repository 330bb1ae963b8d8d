"""Definitions of messages, ROS 1 and ROS 2, taken apart into fields; never executed.

A definition lists fields a line: type, name, for constants a value. What it uses
follows below lines of `=`, each with `MSG: package/Type`. A type that contains itself,
a type that is missing, and one that is too deep or too large are refused.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from analysis.logs.log_file import LARGEST_DEFINITION, Serialization, short_type

MOST_TYPES = 64
DEEPEST = 8
MOST_FIELDS = 1_000
_MOST_EXPANDED = 5_000  # fields of a message with all that it uses
MOST_ELEMENTS = 10_000  # of an array

_SIZES = {
    "bool": "u1",
    "byte": "u1",
    "char": "u1",
    "int8": "i1",
    "uint8": "u1",
    "int16": "i2",
    "uint16": "u2",
    "int32": "i4",
    "uint32": "u4",
    "int64": "i8",
    "uint64": "u8",
    "float32": "f4",
    "float64": "f8",
}
_STAMPS = {"time": "uint32 sec\nuint32 nanosec", "duration": "int32 sec\nint32 nanosec"}
_FIELD = re.compile(
    r"(?P<type>[A-Za-z][\w/]*)(?P<bound><=\d{1,9})?"
    r"(?P<array>\[(?:<=)?\d{0,9}\])?\s+(?P<name>[A-Za-z_]\w*)(?P<rest>\s.*|=.*)?"
)
_SEPARATOR = re.compile(r"^={20,}\s*$", re.MULTILINE)

# What a log without definitions may name; as the packages of ROS 2 state them.
_STAMPED = "std_msgs/Header header\n"
_XYZ = "float64 x\nfloat64 y\nfloat64 z"
COMMON = {
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec",
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id",
    "std_msgs/String": "string data",
    "geometry_msgs/Vector3": _XYZ,
    "geometry_msgs/Wrench": (
        "geometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque"
    ),
    "geometry_msgs/WrenchStamped": f"{_STAMPED}geometry_msgs/Wrench wrench",
    "sensor_msgs/JointState": (
        f"{_STAMPED}string[] name\nfloat64[] position\nfloat64[] velocity\n"
        "float64[] effort"
    ),
}


class DefinitionError(ValueError):
    """A definition cannot be interpreted; the text says why."""


@dataclass(frozen=True, slots=True)
class MessageField:
    """One field of a message.

    Attributes:
        name: as in the definition.
        code: numpy's code of a number without byte order, "s" for a text, "" where
            the field is of another type.
        nested: the fields of that type.
        count: None = one value, -1 = any number of them, else so many.
    """

    name: str
    code: str
    nested: MessageType | None
    count: int | None


@dataclass(frozen=True, slots=True)
class MessageType:
    """The fields of a message in their order.

    Attributes:
        name: package and type.
        fields: in the order of the definition.
    """

    name: str
    fields: tuple[MessageField, ...]

    def field(self, name: str) -> MessageField | None:
        """Return a field by its name; None where there is none."""
        return next((f for f in self.fields if f.name == name), None)

    def paths(self) -> Iterator[tuple[tuple[str, ...], MessageField]]:
        """Give every field with its path, those of nested types behind their own."""
        for each in self.fields:
            yield (each.name,), each
            if each.nested is not None and each.count is None:
                for path, below in each.nested.paths():
                    yield (each.name, *path), below


def message_type(
    type_name: str, definition: str, serialization: Serialization
) -> MessageType:
    """Return the fields of a type by the definition that a log holds.

    Args:
        type_name: of the message.
        definition: its text with what it uses; "" = one of `COMMON`.
        serialization: of ROS 1 or 2, which differ in header and time.

    Raises:
        DefinitionError: the definition is missing, cyclic, too deep, too large, or
            holds what is no field.
    """
    name = short_type(type_name)
    if not definition:
        if name not in COMMON or serialization == "ros1":
            raise DefinitionError(f"the log holds no definition of {name}")
        return _Builder(COMMON, serialization).build(name, ())
    return _Builder(_blocks(name, definition), serialization).build(name, ())


def _blocks(name: str, definition: str) -> dict[str, str]:
    """Return the text of every type by its name."""
    if len(definition) > LARGEST_DEFINITION:
        raise DefinitionError(f"a definition of {len(definition)} bytes")
    first, *others = _SEPARATOR.split(definition)
    texts = {name: first}
    for block in others:
        head, _, text = block.strip().partition("\n")
        if not head.startswith("MSG:"):
            raise DefinitionError("a part of the definition has no name")
        texts[short_type(head.removeprefix("MSG:").strip())] = text
        if len(texts) > MOST_TYPES:
            raise DefinitionError(f"a definition of over {MOST_TYPES} types")
    return texts


class _Builder:
    """Builds types from their texts; counts what it builds."""

    def __init__(self, texts: Mapping[str, str], serialization: str) -> None:
        self._texts = texts
        self._is_ros1 = serialization == "ros1"
        self._expanded = 0

    def build(self, name: str, above: tuple[str, ...]) -> MessageType:
        if name in above:
            raise DefinitionError(f"{name[:60]} contains itself")
        if len(above) >= DEEPEST:
            raise DefinitionError(f"types within types, over {DEEPEST} deep")
        fields = tuple(self._fields(name, (*above, name)))
        return MessageType(name, fields)

    def _fields(self, name: str, above: tuple[str, ...]) -> Iterator[MessageField]:
        count = 0
        for line in self._text(name).splitlines():
            words = line.partition("#")[0].strip()
            if not words:
                continue
            match = _FIELD.fullmatch(words)
            if match is None:
                raise DefinitionError(f"{name[:60]}: {words[:60]!r} is no field")
            rest = (match["rest"] or "").strip()
            if rest.startswith("="):
                continue  # a constant, which no message holds
            count += 1
            self._expanded += 1
            if count > MOST_FIELDS or self._expanded > _MOST_EXPANDED:
                raise DefinitionError(f"{name[:60]} has too many fields")
            yield self._field(name, match, above)

    def _field(
        self, owner: str, match: re.Match[str], above: tuple[str, ...]
    ) -> MessageField:
        count = _count(match["array"])
        kind = match["type"]
        if kind == "string":
            return MessageField(match["name"], "s", None, count)
        if kind in _SIZES:
            code = "i1" if kind == "byte" and self._is_ros1 else _SIZES[kind]
            return MessageField(match["name"], code, None, count)
        nested = self.build(self._resolved(owner, kind), above)
        return MessageField(match["name"], "", nested, count)

    def _resolved(self, owner: str, kind: str) -> str:
        """Return the full name of a type that a definition may name without package."""
        if self._is_ros1 and kind in _STAMPS:
            return kind
        if "/" in kind:
            return short_type(kind)
        beside = f"{owner.partition('/')[0]}/{kind}"
        return "std_msgs/Header" if kind == "Header" != beside else beside

    def _text(self, name: str) -> str:
        if self._is_ros1 and name in _STAMPS:
            return _STAMPS[name]
        if name in self._texts:
            return self._texts[name]
        if not self._is_ros1 and name in COMMON:
            return COMMON[name]
        raise DefinitionError(f"the definition of {name[:60]} is missing")


def _count(array: str | None) -> int | None:
    """Return how many values a field holds; -1 = the message says it."""
    if array is None:
        return None
    digits = array[1:-1]
    if not digits or digits.startswith("<="):
        return -1
    if int(digits) > MOST_ELEMENTS:
        raise DefinitionError(f"an array of {digits} elements")
    return int(digits)
