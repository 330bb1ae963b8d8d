"""Shared slot with the latest value (a seqlock): one writer, any number of readers."""

from acquisition.ipc.shared_memory import LINE

_LENGTH_BYTES = 8
_TRIES = 100  # reads disturbed by the writer until the value counts as empty


class Slot:
    """Latest value as bytes of variable length.

    A counter is odd during a write; a reader compares it before and after reading.
    """

    def __init__(self, memory: memoryview) -> None:
        """Map the slot to `memory`, whose size is that of the largest value plus 64."""
        self._counter = memory[:8].cast("Q")
        self._length = memory[_LENGTH_BYTES : 2 * _LENGTH_BYTES].cast("Q")
        self._bytes = memory[LINE:]

    @property
    def version(self) -> int:
        """Number that changes with every new value."""
        return self._counter[0]

    def write(self, value: bytes) -> None:
        """Replace the value.

        Raises:
            ValueError: the value is too long.
        """
        if len(value) > len(self._bytes):
            raise ValueError(f"{len(value)} bytes, the slot has {len(self._bytes)}")
        counter = self._counter
        counter[0] += 1
        self._length[0] = len(value)
        self._bytes[: len(value)] = value
        counter[0] += 1

    def read(self) -> bytes:
        """Return the latest complete value; empty before the first one."""
        for _ in range(_TRIES):
            before = self._counter[0]
            value = bytes(self._bytes[: self._length[0]])
            if before % 2 == 0 and self._counter[0] == before:
                return value
        return b""
