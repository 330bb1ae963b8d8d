"""The name of a trial on the disk and in every message."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class TrialName:
    """Number and attempt of a trial: T04 while it counts, T04a once rejected."""

    number: int
    attempt: int

    @property
    def kept(self) -> str:
        """Name of the file in trials/."""
        return f"T{self.number:02d}"

    @property
    def rejected(self) -> str:
        """Name of the file in rejected/."""
        letters = ""
        rest = self.attempt
        while rest > 0:
            rest, digit = divmod(rest - 1, 26)
            letters = chr(ord("a") + digit) + letters
        return self.kept + letters
