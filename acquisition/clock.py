"""Clock: the only module that reads the time and waits."""

import ctypes
import errno
import select
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Protocol, runtime_checkable

NS_PER_S = 1_000_000_000
NS_PER_MS = 1_000_000
PERIOD_NS = 2_000_000  # of the control loop, of the records and of the simulated world
RATE_HZ = NS_PER_S // PERIOD_NS
_POLL_NS = 100_000  # polling interval of a link without a descriptor
_TRIES = 20  # readings of UTC


@runtime_checkable
class Readable(Protocol):
    """A link that receives bytes or frames."""

    def fileno(self) -> int:
        """Return the descriptor to wait on, or -1 if there is none."""
        ...

    def is_readable(self) -> bool:
        """Return whether received data wait to be read."""
        ...


class Clock(Protocol):
    """Source of time, real or simulated."""

    def now_ns(self) -> int:
        """Return the monotonic time [ns]."""
        ...

    def utc_ns(self) -> int:
        """Return UTC [ns since 1970]."""
        ...

    def sleep_until(self, t_ns: int) -> None:
        """Sleep until monotonic time `t_ns`; return at once if it has passed."""
        ...

    def wait(self, link: Readable, deadline_ns: int) -> bool:
        """Wait for data; return True if `link` is readable, False at the deadline."""
        ...


class _Timespec(ctypes.Structure):
    _fields_ = [("sec", ctypes.c_long), ("nsec", ctypes.c_long)]


_CLOCK_MONOTONIC = 1
_TIMER_ABSTIME = 1
_PR_SET_TIMERSLACK = 29
_SLACK_NS = 1  # the default timer slack of Linux adds 50 us to a sleep


class SystemClock:
    """Clock of the machine: CLOCK_MONOTONIC, absolute deadlines.

    For the last `spin_ns` before a deadline it busy-waits, which hides late wake-ups of
    the Linux kernel at the cost of a busy core.
    """

    def __init__(self, spin_ns: int = 0) -> None:
        self._spin_ns = spin_ns
        self._nanosleep: Callable[..., int] | None = None
        with suppress(AttributeError, OSError, TypeError):  # only Linux has both
            libc = ctypes.CDLL(None, use_errno=True)
            libc.prctl(_PR_SET_TIMERSLACK, ctypes.c_ulong(_SLACK_NS))
            self._nanosleep = libc.clock_nanosleep
        self._deadline = _Timespec()
        deadline = ctypes.byref(self._deadline)
        self._until = (_CLOCK_MONOTONIC, _TIMER_ABSTIME, deadline, None)

    def now_ns(self) -> int:
        """Return CLOCK_MONOTONIC [ns]."""
        return time.monotonic_ns()

    def utc_ns(self) -> int:
        """Return CLOCK_REALTIME [ns since 1970]."""
        return time.time_ns()

    def sleep_until(self, t_ns: int) -> None:
        """Sleep with clock_nanosleep to the absolute time `t_ns`.

        A signal does not shorten it; its Python handler runs in between.
        """
        wake_ns = t_ns - self._spin_ns
        if self._nanosleep is None:
            time.sleep(max(0, wake_ns - time.monotonic_ns()) / NS_PER_S)
            return
        self._deadline.sec, self._deadline.nsec = divmod(wake_ns, NS_PER_S)
        while self._nanosleep(*self._until) == errno.EINTR:
            pass
        if self._spin_ns:
            while time.monotonic_ns() < t_ns:
                pass

    def wait(self, link: Readable, deadline_ns: int) -> bool:
        """Wait for `link`, with select where it has a descriptor."""
        descriptor = link.fileno()
        while not link.is_readable():
            remaining_ns = deadline_ns - time.monotonic_ns()
            if remaining_ns <= 0:
                return False
            if descriptor >= 0:
                ready = select.select([descriptor], [], [], remaining_ns / NS_PER_S)[0]
                if ready:
                    return True
            else:
                self.sleep_until(min(deadline_ns, time.monotonic_ns() + _POLL_NS))
        return True


def utc_offset_ns(clock: Clock) -> tuple[int, int]:
    """Return (offset, uncertainty) [ns] such that UTC = monotonic + offset.

    UTC is read between two readings of the monotonic clock, repeatedly. The pair with
    the smallest interval counts; half the interval is the uncertainty.
    """
    best: tuple[int, int] | None = None
    for _ in range(_TRIES):
        before = clock.now_ns()
        utc = clock.utc_ns()
        after = clock.now_ns()
        half = (after - before + 1) // 2
        if best is None or half < best[1]:
            best = (utc - (before + after) // 2, half)
    assert best is not None
    return best
