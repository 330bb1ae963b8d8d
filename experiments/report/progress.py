"""Progress and remaining time of a long computation, on one line."""

from collections.abc import Generator
from contextlib import contextmanager

from acquisition.clock import NS_PER_S, Clock, SystemClock
from experiments.operator.console import Console

_STEP = 0.1  # share of the work between two plain lines
_BAR = 30  # characters


class ProgressLine:
    """Shows (done, total) as a bar with the time left; plain lines off a terminal.

    Args:
        console: output.
        clock: clock of the elapsed time.
        what: counted items, e.g. "fits".
    """

    def __init__(self, console: Console, clock: Clock, what: str) -> None:
        self._console, self._clock, self._what = console, clock, what
        self._start_ns = clock.now_ns()
        self._at_first: int | None = None
        self._reported = 0.0

    def __call__(self, done: int, total: int) -> None:
        """Show that `done` of `total` items are done."""
        if self._at_first is None:
            # results of an earlier run appear at once and do not count for the speed
            self._at_first = done - 1 if done == 1 else done
        elapsed = (self._clock.now_ns() - self._start_ns) / NS_PER_S
        left = time_left(done - self._at_first, total - done, elapsed)
        text = progress_text(done, total, left, self._what)
        if self._console.is_live:
            self._console.panel([text])
        elif done == total or done / total >= self._reported + _STEP:
            self._reported = done / total
            self._console.say(text)

    def end(self) -> None:
        """Remove the bar; safe to repeat."""
        self._console.end_panel()


@contextmanager
def fitting(console: Console) -> Generator[ProgressLine]:
    """Show the progress of the fits inside the block."""
    progress = ProgressLine(console, SystemClock(), "fits")
    try:
        yield progress
    finally:
        progress.end()


def time_left(finished: int, left: int, elapsed: float) -> float | None:
    """Remaining time [s] at the speed so far; None if that is unknown.

    Args:
        finished: number of items finished in `elapsed`.
        left: number of remaining items.
        elapsed: time since the start of the first [s].
    """
    if left == 0:
        return 0.0
    return elapsed / finished * left if finished > 0 else None


def progress_text(done: int, total: int, left: float | None, what: str) -> str:
    """Return e.g. "━━━━━╺───── 40 of 88 fits, 1 min 5 s left"."""
    filled = _BAR * done // max(total, 1)
    bar = "━" * filled + "─" * (_BAR - filled)
    if left is None or done >= total:
        return f"{bar} {done} of {total} {what}"
    minutes, seconds = divmod(round(left), 60)
    duration = f"{minutes} min {seconds} s" if minutes else f"{seconds} s"
    return f"{bar} {done} of {total} {what}, {duration} left"
