"""The page of the preflight: one line per check, errors raised at its end."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

from acquisition.errors import PreflightError
from experiments.operator.console import Console

_T = TypeVar("_T")


@dataclass(frozen=True, slots=True)
class CheckResult:
    """One line of the page."""

    mark: str
    name: str
    text: str


class ChecksPage:
    """Lines of the checks; a failure does not prevent the next check.

    Attributes:
        checks: the printed lines.
    """

    def __init__(self, console: Console) -> None:
        self.checks: list[CheckResult] = []
        self._console = console
        self._failures: list[PreflightError] = []

    def add(self, mark: str, name: str, text: str) -> None:
        """Print one line and keep it."""
        self.checks.append(CheckResult(mark, name, text))
        self._console.check(mark, name, text)

    def add_result(self, result: CheckResult | None) -> None:
        """Print the line of a check, if it has one."""
        if result is not None:
            self.add(result.mark, result.name, result.text)

    def fail(self, error: PreflightError) -> None:
        """Keep an error until the other checks have run."""
        self._failures.append(error)

    def attempt(self, check: Callable[[], _T]) -> _T | None:
        """Run a check; returns its result, None if it failed."""
        try:
            return check()
        except PreflightError as error:
            self.fail(error)
            return None

    def require_fit(self) -> None:
        """Raise the first error, after printing the others."""
        if not self._failures:
            return
        first, *others = self._failures
        for error in others:
            self._console.say(f"Also: {error}")
        raise first
