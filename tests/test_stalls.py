"""Which failures a machine that stands still excuses."""

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


class Told(WallClock):
    """As it is, but for a machine of which is said whether it stood still."""

    def __init__(self, *, stood_still):
        super().__init__()
        self._stood_still = stood_still

    def has_stalled(self):
        return self._stood_still


@pytest.fixture
def outcome(pytester):
    def run(*, passes=1, stepped=True, stood_still=False):
        pytester.makeini("[pytest]\nmarkers = wall_clock: waits\n")
        pytester.makepyfile(TEST.format(passes=passes, stepped=stepped))
        ran = pytester.inline_run(plugins=[Told(stood_still=stood_still)])
        ends = [r.outcome for r in ran.getreports() if getattr(r, "when", "") == "call"]
        return [ends.count(outcome) for outcome in ("passed", "rerun", "failed")]

    return run


def test_a_failure_beside_a_stall_is_repeated(outcome):
    assert outcome(passes=RERUNS + 1, stood_still=True) == [2, RERUNS, 0]


def test_a_failure_without_a_stall_is_one(outcome):
    assert outcome(passes=2) == [1, 0, 1]


def test_what_fails_every_time_fails(outcome):
    assert outcome(passes=RERUNS + 2, stood_still=True) == [1, RERUNS, 1]


def test_what_needs_no_clock_is_not_repeated(outcome):
    assert outcome(stepped=False, stood_still=True) == [1, 0, 1]
