"""What is said to the person: the one place that prints."""

import io
import os
import sys
from collections.abc import Sequence

GOOD, WARNING, BAD = "✔", "▲", "✘"


class Console:
    """Prints plain lines; the same without a terminal.

    Attributes:
        is_lost: nobody reads any more: the other end of the pipe was closed.
    """

    def __init__(self, *, color: bool = True) -> None:
        self.is_lost = False
        self._color = color and sys.stdout.isatty()
        for stream in (sys.stdout, sys.stderr):
            if isinstance(stream, io.TextIOWrapper):
                stream.reconfigure(errors="replace")  # a sign is worth no crash

    def say(self, text: str = "") -> None:
        """Print one line; a closed pipe is remembered, never raised."""
        if self.is_lost:
            return
        try:
            print(text, flush=True)
        except BrokenPipeError:
            self.is_lost = True
            _discard_output()

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


def _discard_output() -> None:
    """Point stdout at nothing, or Python would fail again when it flushes at exit."""
    nothing = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nothing, sys.stdout.fileno())
    os.close(nothing)
