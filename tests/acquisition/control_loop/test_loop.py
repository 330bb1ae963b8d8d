import itertools

import pytest

from acquisition.control_loop.loop import Loop
from fakes.clock import SteppedClock

MS = 1_000_000


class Work:
    """A cycle with a scripted duration for each cycle number."""

    def __init__(self):
        self.clock = SteppedClock()
        self.ticks = []
        self.durations = {}
        self.loop = Loop(self, self.clock)

    def __call__(self, tick):
        self.ticks.append(tick)
        busy = self.durations.get(tick.number, 0)
        self.clock.sleep_until(self.clock.now_ns() + busy)

    @property
    def numbers(self):
        return [tick.number for tick in self.ticks]


@pytest.fixture
def work():
    return Work()


def test_cycles_run_at_the_nominal_period(work):
    work.loop.run(100)
    times = [tick.now_ns for tick in work.ticks]
    assert {b - a for a, b in itertools.pairwise(times)} == {2 * MS}
    assert work.numbers == list(range(100))


def test_work_within_the_period_does_not_shift_the_grid(work):
    work.durations = dict.fromkeys(range(50), int(1.99 * MS))
    work.loop.run(50)
    deadlines = [tick.deadline_ns for tick in work.ticks]
    assert deadlines[-1] - deadlines[0] == 49 * 2 * MS
    assert work.loop.stats.late == 0


def test_a_slightly_late_cycle_runs_and_is_not_counted(work):
    work.durations = {3: int(2.5 * MS)}
    work.loop.run(6)
    assert work.numbers == [0, 1, 2, 3, 4, 5]
    assert work.loop.stats.late == 0


def test_a_cycle_late_by_the_limit_is_counted(work):
    work.durations = {3: int(2.5 * MS) + 1}
    work.loop.run(6)
    assert [tick.number for tick in work.ticks if tick.is_late] == [4]
    assert work.numbers == [0, 1, 2, 3, 4, 5]
    assert work.loop.stats.late == 1
    assert work.loop.stats.worst_late_ns == MS // 2 + 1


def test_missed_cycles_are_skipped_and_counted(work):
    work.durations = {3: 7 * MS}
    work.loop.run(10)
    assert work.numbers == [0, 1, 2, 3, 6, 7, 8, 9]
    assert work.loop.stats.skipped == 2
    assert work.loop.stats.cycles == 8


def test_a_skip_is_marked_on_the_cycle_after_it(work):
    work.durations = {3: 6 * MS}  # exactly three periods: on the grid again
    work.loop.run(10)
    late = [tick for tick in work.ticks if tick.is_late]
    assert [tick.number for tick in late] == [6]
    assert work.loop.stats.worst_late_ns == 4 * MS


def test_there_is_no_burst_after_a_stall(work):
    work.durations = {3: 101 * MS}
    work.loop.run(70)
    after = [tick.now_ns for tick in work.ticks if tick.number > 53]
    assert min(b - a for a, b in itertools.pairwise(after)) == 2 * MS


def test_the_grid_is_unchanged_by_a_stall(work):
    work.durations = {3: 101 * MS}
    work.loop.run(70)
    first, last = work.ticks[0], work.ticks[-1]
    assert last.deadline_ns - first.deadline_ns == (last.number - first.number) * 2 * MS


def test_running_counts_periods_not_calls(work):
    work.durations = {0: 20 * MS}
    work.loop.run(5)
    assert work.numbers == [0, 10]


def test_an_unannounced_pause_is_a_stall(work):
    work.loop.run(3)
    work.clock.sleep_until(work.clock.now_ns() + 1000 * MS)
    work.loop.step()
    assert work.loop.stats.skipped == 499


def test_another_period_is_also_kept():
    clock = SteppedClock()
    times = []
    Loop(lambda tick: times.append(tick.now_ns), clock, period_ns=5 * MS).run(4)
    assert [b - a for a, b in itertools.pairwise(times)] == [5 * MS] * 3
