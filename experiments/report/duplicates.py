"""Trials that are given twice: left out or not, they would be fitted as two."""

from hashlib import blake2b
from typing import Any

from numpy.typing import NDArray


class TrialDigests:
    """What trials hold, to find one that holds the same as one before it."""

    def __init__(self) -> None:
        self._first: dict[bytes, str] = {}

    def original(self, name: str, *columns: NDArray[Any]) -> str | None:
        """Return the name of an earlier trial with the same columns; None without.

        Args:
            name: of the trial.
            columns: all that it holds.
        """
        digest = blake2b()
        for column in columns:
            digest.update(column.tobytes())
        first = self._first.setdefault(digest.digest(), name)
        return None if first is name else first
