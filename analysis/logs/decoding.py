"""Messages read by their definition: CDR of ROS 2, and the serialisation of ROS 1.

CDR aligns every number to its own size, counted from behind the four bytes that state
the byte order (plain CDR of DDS-XTypes 1.3, 7.4.3); ROS 1 aligns nothing and is
little-endian. An array without a size states how many elements it has: that many have
to be there before anything is allocated for them.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from typing import Any

import numpy as np

from analysis.logs.definitions import MOST_ELEMENTS, MessageField, MessageType
from analysis.logs.log_file import LONGEST_NAME, Serialization

_CODES = {
    "u1": "B",
    "i1": "b",
    "u2": "H",
    "i2": "h",
    "u4": "I",
    "i4": "i",
    "u8": "Q",
    "i8": "q",
    "f4": "f",
    "f8": "d",
}
_MOST_VALUES = 100_000  # fields of one message, nested ones included


class MessageError(ValueError):
    """A message is not what its definition says; the text says where."""


def decoded(
    data: bytes, kind: MessageType, serialization: Serialization
) -> dict[str, Any]:
    """Return the fields of a message by name; nested types are mappings again.

    Arrays of numbers are numpy arrays, texts are str, arrays of texts and of other
    types are lists.

    Raises:
        MessageError: it is too short, or states an absurd count.
    """
    try:
        return _Cursor(data, serialization).message(kind)
    except struct.error as error:
        raise MessageError("it is shorter than its type") from error


def value_at(message: Mapping[str, Any], path: tuple[str, ...]) -> Any:  # noqa: ANN401
    """Return what stands at a path of field names."""
    found: Any = message
    for name in path:
        found = found[name]
    return found


class _Cursor:
    """Reads one message from its begin to its end."""

    def __init__(self, data: bytes, serialization: Serialization) -> None:
        self._data = data
        self._is_cdr = serialization == "cdr"
        self._order, self._at, self._origin = "<", 0, 0
        self._left = _MOST_VALUES
        if self._is_cdr:
            if len(data) < 4 or data[0] != 0 or data[1] not in (0, 1):
                raise MessageError(f"it begins with {data[:2].hex()}, not as plain CDR")
            self._order = "<" if data[1] else ">"
            self._at = self._origin = 4

    def message(self, kind: MessageType) -> dict[str, Any]:
        self._left -= 1 + len(kind.fields)
        if self._left < 0:  # arrays of types that need no bytes
            raise MessageError("it has too many fields")
        if not kind.fields and self._is_cdr:
            self._at += 1  # an empty type has a byte in ROS 2
        return {each.name: self._field(each) for each in kind.fields}

    def _field(self, field: MessageField) -> Any:  # noqa: ANN401
        if field.count is None:
            return self._one(field)
        count = field.count if field.count >= 0 else int(self._number("u4"))
        if count > MOST_ELEMENTS:
            raise MessageError(f"{field.name} states {count} elements")
        if field.code and field.code != "s":
            return self._numbers(field, count)
        return [self._one(field) for _ in range(count)]

    def _one(self, field: MessageField) -> Any:  # noqa: ANN401
        if field.code == "s":
            return self._text(field.name)
        if field.code:
            return self._number(field.code)
        assert field.nested is not None
        return self.message(field.nested)

    def _number(self, code: str) -> int | float:
        size = int(code[1])
        self._align(size)
        (value,) = struct.unpack_from(self._order + _CODES[code], self._data, self._at)
        self._at += size
        return value

    def _numbers(self, field: MessageField, count: int) -> np.ndarray:
        size = int(field.code[1])
        if count:
            self._align(size)
        if count * size > len(self._data) - self._at:
            raise MessageError(f"{field.name} states {count} elements")
        order = f"{self._order}{field.code}"
        found = np.frombuffer(self._data, order, count, self._at)
        self._at += count * size
        return found

    def _text(self, name: str) -> str:
        size = int(self._number("u4"))
        if size > LONGEST_NAME or size > len(self._data) - self._at:
            raise MessageError(f"{name} states a text of {size} bytes")
        text = self._data[self._at : self._at + size]
        self._at += size
        return text.rstrip(b"\0").decode(errors="replace")

    def _align(self, size: int) -> None:
        if self._is_cdr:
            self._at += -(self._at - self._origin) % size
