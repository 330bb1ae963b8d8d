"""What is said to the person: the one place that prints."""

import sys
from collections.abc import Sequence

GOOD, WARNING, BAD = "✔", "▲", "✘"


class Console:
    """Prints plain lines; the same without a terminal."""

    def __init__(self, *, color: bool = True) -> None:
        self._color = color and sys.stdout.isatty()

    def say(self, text: str = "") -> None:
        """Print one line."""
        print(text, flush=True)

    def check(self, mark: str, name: str, text: str) -> None:
        """Print one line of a graded page."""
        self.say(f" {mark} {name:<14} {text}")

    def problem(self, text: str) -> None:
        """Print an error to stderr."""
        print(text, file=sys.stderr, flush=True)

    def table(self, header: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
        """Print a table with rich, in colour where there is a terminal."""
        from rich.console import Console as RichConsole
        from rich.table import Table

        table = Table(*header, box=None, pad_edge=False)
        for row in rows:
            table.add_row(*row)
        RichConsole(no_color=not self._color, highlight=False, markup=False).print(
            table
        )
