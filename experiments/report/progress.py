"""Progress and remaining time of a long computation, on one line."""

from collections.abc import Generator
from contextlib import contextmanager

from acquisition.clock import NS_PER_S, Clock, SystemClock
from acquisition.cores import available_cores
from experiments.operator.console import Console

_STEP = 0.1  # share of the work between two plain lines
_BAR = 30  # characters


class ProgressLine:
    """Shows (done, total) as a bar with the time left; plain lines off a terminal.

    The pace counts from the first result computed here: what was stored appears at
    once, and the first result also waits for its process to start. It is measured over
    whole rounds of the results that are computed at a time.

    Args:
        console: output.
        clock: clock of the elapsed time.
        what: counted items, e.g. "fits".
        abreast: items computed at a time, whose results appear together.
    """

    def __init__(
        self, console: Console, clock: Clock, what: str, abreast: int = 1
    ) -> None:
        self._console, self._clock, self._what = console, clock, what
        self._abreast = abreast
        self._has_stored = False
        self._first: tuple[int, int] | None = None  # done, and when [ns]
        self._pace: float | None = None  # s for an item
        self._reported = 0.0

    def __call__(self, done: int, total: int) -> None:
        """Show that `done` of `total` items are done."""
        left = self._time_left(done, total)
        text = progress_text(done, total, left, self._what)
        if self._console.is_live:
            self._console.panel([text])
        elif done == total or done / total >= self._reported + _STEP:
            self._reported = done / total
            self._console.say(text)

    def _time_left(self, done: int, total: int) -> float | None:
        if self._first is None:
            if done > 1 and not self._has_stored:
                self._has_stored = True
            else:
                self._first = done, self._clock.now_ns()
            return None
        first, start_ns = self._first
        if (done - first) % self._abreast == 0:
            elapsed = (self._clock.now_ns() - start_ns) / NS_PER_S
            self._pace = elapsed / (done - first)
        return None if self._pace is None else self._pace * (total - done)

    def end(self) -> None:
        """Remove the bar; safe to repeat."""
        self._console.end_panel()


@contextmanager
def fitting(console: Console) -> Generator[ProgressLine]:
    """Show the progress of the fits inside the block."""
    progress = ProgressLine(console, SystemClock(), "fits", available_cores())
    try:
        yield progress
    finally:
        progress.end()


def progress_text(done: int, total: int, left: float | None, what: str) -> str:
    """Return e.g. "━━━━━╺───── 40 of 88 fits, 1 min 5 s left"."""
    filled = _BAR * done // max(total, 1)
    bar = "━" * filled + "─" * (_BAR - filled)
    if left is None or done >= total:
        return f"{bar} {done} of {total} {what}"
    minutes, seconds = divmod(round(left), 60)
    duration = f"{minutes} min {seconds} s" if minutes else f"{seconds} s"
    return f"{bar} {done} of {total} {what}, {duration} left"
