"""Only failures of wall-clock tests during a stall are repeated."""

import pytest

from tests.stalls import RERUNS, WallClock

pytest_plugins = ["pytester"]
TEST = """
import pytest
attempts = []

@pytest.mark.wall_clock
def test_on_the_wall_clock():
    attempts.append(1)
    assert len(attempts) >= {passes}

def test_on_stepped_time():
    assert {stepped}
"""


class StatedStall(WallClock):
    """WallClock with a stated answer: stalled or not."""

    def __init__(self, *, stalled):
        super().__init__()
        self._stalled = stalled

    def has_stalled(self):
        return self._stalled


@pytest.fixture
def outcome(pytester):
    def run(*, passes=1, stepped=True, stalled=False):
        pytester.makeini("[pytest]\nmarkers = wall_clock: waits\n")
        pytester.makepyfile(TEST.format(passes=passes, stepped=stepped))
        ran = pytester.inline_run(plugins=[StatedStall(stalled=stalled)])
        ends = [r.outcome for r in ran.getreports() if getattr(r, "when", "") == "call"]
        return [ends.count(outcome) for outcome in ("passed", "rerun", "failed")]

    return run


def test_a_failure_during_a_stall_is_repeated(outcome):
    assert outcome(passes=RERUNS + 1, stalled=True) == [2, RERUNS, 0]


def test_a_failure_without_a_stall_is_not_repeated(outcome):
    assert outcome(passes=2) == [1, 0, 1]


def test_a_test_that_fails_every_time_fails(outcome):
    assert outcome(passes=RERUNS + 2, stalled=True) == [1, RERUNS, 1]


def test_a_failure_on_stepped_time_is_not_repeated(outcome):
    assert outcome(stepped=False, stalled=True) == [1, 0, 1]
