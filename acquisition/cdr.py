"""CDR writer for messages of variable size: events, views, batches."""

import struct
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from acquisition.schema import ENCAPSULATION

NS_PER_S = 1_000_000_000


class CdrWriter:
    """Appends fields, each aligned to its size, after the encapsulation header."""

    def __init__(self) -> None:
        self._data = bytearray(ENCAPSULATION)

    def scalar(self, code: str, value: float) -> "CdrWriter":
        """Append one number; `code` is a letter of the struct module."""
        self._align(struct.calcsize(code))
        self._data += struct.pack(f"<{code}", value)
        return self

    def string(self, text: str) -> "CdrWriter":
        """Append a string: length with its NUL, bytes, NUL.

        Lone surrogates become "?": a malformed note must not end a recording.
        """
        encoded = text.encode(errors="replace") + b"\0"
        self.scalar("I", len(encoded))
        self._data += encoded
        return self

    def strings(self, texts: Sequence[str]) -> "CdrWriter":
        """Append a sequence of strings."""
        self.scalar("I", len(texts))
        for text in texts:
            self.string(text)
        return self

    def array(self, values: "NDArray[np.generic]") -> "CdrWriter":
        """Append numbers without a count (a fixed array or nested fields)."""
        self._align(values.dtype.itemsize)
        self._data += np.ascontiguousarray(values).tobytes()
        return self

    def sequence(self, values: "NDArray[np.generic]") -> "CdrWriter":
        """Append a count and the numbers."""
        self.scalar("I", values.size)
        if values.size:
            self.array(values)
        return self

    def stamp(self, t_ns: int) -> "CdrWriter":
        """Append a builtin_interfaces/Time of UTC `t_ns`."""
        seconds, nanoseconds = divmod(t_ns, NS_PER_S)
        return self.scalar("i", seconds).scalar("I", nanoseconds)

    def header(self, t_ns: int, frame_id: str) -> "CdrWriter":
        """Append a std_msgs/Header."""
        return self.stamp(t_ns).string(frame_id)

    def finish(self) -> bytes:
        """Return the payload."""
        return bytes(self._data)

    def _align(self, size: int) -> None:
        self._data += b"\0" * (-(len(self._data) - 4) % size)


def encode_string(text: str) -> bytes:
    """Return a std_msgs/String payload."""
    return CdrWriter().string(text).finish()


def encode_log(t_ns: int, level: int, name: str, text: str) -> bytes:
    """Return an rcl_interfaces/Log payload; `level` is 10, 20, 30, 40 or 50."""
    writer = CdrWriter().stamp(t_ns).scalar("B", level).string(name).string(text)
    return writer.string("").string("").scalar("I", 0).finish()
