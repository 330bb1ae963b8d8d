"""Timing of the loop: absolute deadlines on a fixed grid, overruns skip cycles."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from acquisition.clock import PERIOD_NS, Clock

LATE_NS = 500_000  # a cycle that begins later than this is late


class Tick(NamedTuple):
    """Timing of a cycle; a tuple takes half the time of a frozen dataclass to create.

    Attributes:
        number: cycle number, skipped cycles included.
        now_ns: start of the cycle [ns].
        deadline_ns: scheduled start [ns].
        is_late: started more than 0.5 ms after its deadline, or after skipped cycles.
        skipped: number of cycles skipped before it.
    """

    number: int
    now_ns: int
    deadline_ns: int
    is_late: bool
    skipped: int = 0


@dataclass(slots=True)
class LoopStats:
    """Timing statistics of the loop."""

    cycles: int = 0
    skipped: int = 0
    late: int = 0
    worst_late_ns: int = 0


class Loop:
    """Calls `cycle` on a fixed grid of `period_ns`.

    After an overrun the loop skips whole periods: there is no burst of catch-up cycles,
    and the numbers of skipped cycles are missing in the record. `stats` is updated in
    every step.
    """

    def __init__(
        self,
        cycle: Callable[[Tick], None],
        clock: Clock,
        period_ns: int = PERIOD_NS,
        stats: LoopStats | None = None,
    ) -> None:
        self._cycle = cycle
        self._clock = clock
        self._period_ns = period_ns
        self._next_ns: int | None = None
        self._number = 0
        self.stats = stats if stats is not None else LoopStats()

    def run(self, cycles: int) -> None:
        """Run until `cycles` periods have passed on the grid."""
        end = self._number + cycles
        while self._number < end:
            self.step()

    def step(self) -> None:
        """Wait for the next deadline and run one cycle."""
        clock = self._clock
        if self._next_ns is None:
            self._next_ns = clock.now_ns() + self._period_ns
        clock.sleep_until(self._next_ns)
        now = clock.now_ns()
        behind = (now - self._next_ns) // self._period_ns
        if behind > 0:
            self._next_ns += behind * self._period_ns
            self._number += behind
            self.stats.skipped += behind
        late_ns = now - self._next_ns
        is_late = behind > 0 or late_ns > LATE_NS
        self.stats.late += is_late
        self.stats.worst_late_ns = max(
            self.stats.worst_late_ns, late_ns + behind * self._period_ns
        )
        skipped = max(behind, 0)
        self._cycle(Tick(self._number, now, self._next_ns, is_late, skipped))
        self.stats.cycles += 1
        self._number += 1
        self._next_ns += self._period_ns
