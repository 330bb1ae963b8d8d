"""Detection of duplicate trials, which would otherwise be fitted as two."""

from hashlib import blake2b
from typing import Any

from numpy.typing import NDArray


class TrialDigests:
    """Digests of trials, to find duplicates."""

    def __init__(self) -> None:
        self._first: dict[bytes, str] = {}

    def original(self, name: str, *columns: NDArray[Any]) -> str | None:
        """Return the name of an earlier trial with the same columns, or None.

        Args:
            name: name of the trial.
            columns: its content.
        """
        digest = blake2b()
        for column in columns:
            digest.update(column.tobytes())
        first = self._first.setdefault(digest.digest(), name)
        return None if first is name else first
