"""How late the loop's cycles begin while something else runs beside it."""

import numpy as np
from numpy.typing import NDArray

from acquisition.ipc.layout import SharedLayout
from lab.guest.commands import require, wait

WINDOW = 2.0  # s
MOST_LATER = 3.0  # us, that something beside it may add to the 99 % quantile
_CYCLES_PER_S = 500
Lateness = NDArray[np.float64]


def memory_of(pid: int) -> SharedLayout:
    """Return the shared memory of a running session.

    Raises:
        ScenarioError: it is not found.
    """
    shared = SharedLayout.of_process(pid)
    require(shared is not None, "the session's memory is not found")
    assert shared is not None
    return shared


def lateness(shared: SharedLayout) -> Lateness:
    """Return how late each cycle of a window began [us], shape (n,)."""
    wait(WINDOW)
    rows = shared.timings.last(round(WINDOW * _CYCLES_PER_S))
    late = rows["woke_ns"].astype(np.int64) - rows["deadline_ns"].astype(np.int64)
    return np.asarray(late * 1e-3, np.float64)


def require_on_time(
    beside: Lateness, alone: Lateness, others: dict[str, Lateness]
) -> dict[str, str]:
    """Return the figures of all windows.

    Args:
        beside: a window with something beside the loop.
        alone: one without.
        others: further windows by name.

    Raises:
        ScenarioError: the 99 % quantile is more than 3 us later beside it.
    """
    windows = {"alone": alone, "beside": beside, **others}
    figures = {name: _words(window) for name, window in windows.items()}
    later = float(np.quantile(beside, 0.99) - np.quantile(alone, 0.99))
    require(later <= MOST_LATER, f"p99 {later:.1f} us later: {figures}")
    return figures


def _words(late: Lateness) -> str:
    low, high = np.quantile(late, [0.5, 0.99])
    return f"p50 {low:.1f} us, p99 {high:.1f} us, worst {late.max():.1f} us"
