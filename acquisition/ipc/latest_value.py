"""A slot with the latest value of something: one writer, any readers, no locks."""

from acquisition.ipc.shared_memory import LINE

_LENGTH_BYTES = 8
_TRIES = 100  # a reader that is beaten this often takes what is there for nothing


class Slot:
    """The newest value of something, as bytes of changing length: one writer.

    A counter is odd while the value is being written; a reader looks at it before and
    after.
    """

    def __init__(self, memory: memoryview) -> None:
        """Lay the slot over `memory`, whose size is the largest value plus 64."""
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
            ValueError: it does not fit.
        """
        if len(value) > len(self._bytes):
            raise ValueError(f"{len(value)} bytes, the slot has {len(self._bytes)}")
        counter = self._counter
        counter[0] += 1
        self._length[0] = len(value)
        self._bytes[: len(value)] = value
        counter[0] += 1

    def read(self) -> bytes:
        """Return the newest whole value; empty before the first one."""
        for _ in range(_TRIES):
            before = self._counter[0]
            value = bytes(self._bytes[: self._length[0]])
            if before % 2 == 0 and self._counter[0] == before:
                return value
        return b""
