"""Output to the operator: the only module that prints."""

import errno
import io
import os
import shutil
import sys
import textwrap
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, TextIO

from acquisition.errors import TractionError

if TYPE_CHECKING:
    from rich.live import Live

GOOD, WARNING, BAD = "✔", "▲", "✘"
AddLine = Callable[[str, str, str], None]  # mark, name and text of a graded line
_GRADES = {GOOD: "good", WARNING: "warning", BAD: "bad"}
_ARM, _ARM_WHOLE = "ARM: ", "ARM:\N{NO-BREAK SPACE}"
_BELOW_TEXT = " " * 18  # indent of the text of a graded line


class OutputError(TractionError):
    """The output of a command cannot be written.

    Args:
        error: error of the operating system.
    """

    exit_code = 6

    def __init__(self, error: OSError) -> None:
        super().__init__(
            f"The output cannot be written ({error.strerror}).",
            hint="Make room, or send it elsewhere. Recorded data are safe.",
        )


class Console:
    """Prints lines, and on a terminal a changing panel below them.

    Args:
        color: use colours and a panel on a terminal.
        goes_on: report a failure of the output once and go on, because an arm moves or
            trials are recorded.

    Attributes:
        is_lost: whether the other end of the pipe was closed.
        is_live: whether there is a terminal that can show a panel.
    """

    def __init__(self, *, color: bool = True, goes_on: bool = False) -> None:
        self.is_lost = False
        self._goes_on = goes_on
        self._is_terminal = sys.stdout.isatty()
        self._color = color and self._is_terminal
        self.is_live = self._color and os.environ.get("TERM", "dumb") != "dumb"
        self._live: Live | None = None
        for stream in (sys.stdout, sys.stderr):
            if isinstance(stream, io.TextIOWrapper):
                stream.reconfigure(
                    errors="replace"
                )  # an unprintable character must not crash

    def say(self, text: str = "", *, indent: str = "") -> None:
        """Print one line; a closed pipe or terminal only sets `is_lost`.

        Args:
            text: the line, wrapped at the width of a terminal.
            indent: indent of the lines after a break.

        Raises:
            OutputError: the disk is full, unless `goes_on`.
        """
        self._say(text, indent)

    def _say(self, text: str, indent: str) -> None:
        if self.is_lost:
            return
        if self._is_terminal:
            text = wrapped(text, self.width, indent)
        try:
            if self._live is not None:
                self._live.console.print(text, markup=False, highlight=False)
            else:
                print(text, flush=True)
        except OSError as error:
            self._lose(error)

    def check(self, mark: str, name: str, text: str) -> None:
        """Print one line of a graded page."""
        self._say(f" {mark} {name:<14} {text}", _BELOW_TEXT)

    def problem(self, text: str) -> None:
        """Print an error to stderr."""
        self.end_panel()
        if sys.stderr.isatty():
            text = wrapped(text, self.width)
        try:
            print(text, file=sys.stderr, flush=True)
        except OSError:  # no stream is left to report it
            discard(sys.stderr)

    @property
    def width(self) -> int:
        """Width of the terminal [characters], 80 if there is none."""
        return shutil.get_terminal_size((80, 24)).columns

    def panel(self, lines: Sequence[str]) -> None:
        """Show `lines` below the output, replacing the previous panel."""
        if not self.is_live or self.is_lost:
            return
        from rich.text import Text

        from experiments.operator.graphs import fitted

        size = shutil.get_terminal_size((80, 24))
        shown = fitted(lines, size.columns, size.lines - 1)
        text = Text("\n".join(shown), no_wrap=True, overflow="ellipsis")
        try:
            if self._live is None:
                self._live = self._begin_live()
            self._live.update(text, refresh=True)
        except OSError as error:
            self._lose(error)

    def end_panel(self) -> None:
        """Remove the panel; safe to repeat."""
        live, self._live = self._live, None
        if live is not None:
            try:
                live.stop()
            except OSError as error:
                self._lose(error)

    def sound(self, times: int = 1) -> None:
        """Sound the terminal's bell, if there is a terminal."""
        if not self._is_terminal or self.is_lost:
            return
        try:
            sys.stdout.write("\a" * times)
            sys.stdout.flush()
        except OSError as error:
            self._lose(error)

    def _lose(self, error: OSError) -> None:
        """Drop further output; a closed reader is no fault, a full disk is one.

        Raises:
            OutputError: the disk is full, unless `goes_on`.
        """
        self.is_lost = True
        self._live = None
        discard(sys.stdout)
        if isinstance(error, BrokenPipeError) or error.errno == errno.EIO:
            return  # closed pipe or terminal
        fault = OutputError(error)
        if not self._goes_on:
            raise fault from error
        self.problem(f"{WARNING} {fault}")

    def _begin_live(self) -> "Live":
        from rich.console import Console as RichConsole
        from rich.live import Live

        console = RichConsole(highlight=False, markup=False)
        live = Live(console=console, auto_refresh=False, transient=True)
        live.start()
        return live

    def table(self, header: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
        """Print a table; on a terminal in bold and fitted to its width."""
        if not self._is_terminal:
            for line in aligned([header, *rows]):
                self.say(line)
            return
        from rich.console import Console as RichConsole
        from rich.table import Table

        table = Table(*header, box=None, pad_edge=False)
        for row in rows:
            table.add_row(*row)
        RichConsole(no_color=not self._color, highlight=False, markup=False).print(
            table
        )


class PageRecorder(Console):
    """Records the graded lines of a page and prints nothing.

    Attributes:
        checks: grade ("good", "warning", "bad"), name and text of every line.
    """

    def __init__(self) -> None:
        super().__init__(color=False)
        self.checks: list[dict[str, str]] = []

    def check(self, mark: str, name: str, text: str) -> None:
        """Record one line of a graded page."""
        self.checks.append({"grade": _GRADES[mark], "name": name, "text": text})

    def table(self, header: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
        """Discard a table."""

    def say(self, text: str = "", *, indent: str = "") -> None:
        """Print nothing: the page is for a program."""


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return the rows as lines with aligned columns."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]


def wrapped(text: str, width: int, indent: str = "") -> str:
    """Wrap `text` between words at `width`; a longer word stays whole.

    The state of the arm is not separated from "ARM:".

    Args:
        text: lines to wrap.
        width: width of the terminal [characters].
        indent: indent of the lines after a break.
    """
    lines = [
        textwrap.fill(
            line.replace(_ARM, _ARM_WHOLE),
            width,
            subsequent_indent=indent,
            break_long_words=False,
            break_on_hyphens=False,
        )
        for line in text.split("\n")
    ]
    return "\n".join(lines).replace(_ARM_WHOLE, _ARM)


def discard(stream: TextIO) -> None:
    """Redirect a stream to the null device, so that Python's flush at exit succeeds."""
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, stream.fileno())
    os.close(null)
