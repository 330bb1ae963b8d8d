"""The host reads results, hangs and crashes from the console of a machine."""

from dataclasses import replace

import pytest

from lab.follower import LIMIT, PANICKED, Follower
from lab.results import (
    AllFinished,
    ScenarioResult,
    ScenarioStarted,
    TimerLocation,
    Verdict,
    to_line,
)

SENT = ScenarioResult("bench", Verdict.PASSED, 1.0)
PASSED = replace(SENT, processor=1.0)  # as the host completes it
FINISHED = to_line(AllFinished(2.0))


class ScriptedConsole:
    """The console of a machine that ends or hangs after its lines."""

    def __init__(self, *lines, is_hanging=False):
        self._lines = list(lines)
        self._taken = 0.0
        self._is_hanging = is_hanging

    def processor_seconds(self):
        """Return a second more at each call."""
        self._taken += 1.0
        return self._taken

    def correct_timer(self, found):
        self.found = found

    def line(self, until_ns):
        assert until_ns > 0
        if self._lines:
            return self._lines.pop(0)
        if self._is_hanging:
            raise TimeoutError
        return None


def follow(machine, *names):
    return Follower(is_shown=False).follow(machine, names)


def test_a_result_is_read_among_other_lines():
    lines = [to_line(ScenarioStarted("bench")), "[ 1.0] usb", to_line(SENT), FINISHED]
    assert follow(ScriptedConsole(*lines), "bench") == [PASSED]


def test_a_timer_reported_by_the_machine_is_corrected():
    found = TimerLocation(0x1FDC0, 0xFFFF_FFFF_8241_CB60)
    machine = ScriptedConsole(
        to_line(found), to_line(ScenarioStarted("bench")), to_line(SENT), FINISHED
    )
    assert follow(machine, "bench") == [PASSED]
    assert machine.found == found


@pytest.mark.parametrize("is_hanging", [True, False])
def test_the_scenario_during_which_a_machine_is_lost_is_reported(is_hanging):
    lines = [
        to_line(ScenarioStarted("bench")),
        to_line(SENT),
        to_line(ScenarioStarted("session")),
    ]
    machine = ScriptedConsole(*lines, "Oops: 0002", is_hanging=is_hanging)
    passed, lost = follow(machine, "bench", "session", "never begun")
    assert passed == PASSED
    assert (lost.name, lost.verdict) == ("session", Verdict.HUNG)
    assert "Oops" in lost.output


def test_a_machine_that_does_not_boot_is_reported_as_hung_in_its_boot():
    (lost,) = follow(ScriptedConsole("Kernel panic"), "bench")
    assert (lost.name, lost.verdict) == ("boot", Verdict.HUNG)
    assert (lost.reason, lost.output) == (PANICKED, "Kernel panic")


def test_a_machine_that_skips_scenarios_is_reported_as_hung():
    lines = [to_line(ScenarioStarted("bench")), to_line(SENT), FINISHED]
    results = follow(ScriptedConsole(*lines), "bench", "session")
    assert results[-1].verdict is Verdict.HUNG


class Starved(ScriptedConsole):
    """A machine on a busy host: silent for `silences`, running a `share` of each."""

    def __init__(self, *lines, silences, share=0.1):
        super().__init__(*lines)
        self._silences = silences
        self._share = share

    def processor_seconds(self):
        return self._taken

    def line(self, until_ns):
        if len(self._lines) == 2 and self._silences:  # before the result
            self._silences -= 1
            self._taken += self._share * LIMIT
            raise TimeoutError
        return super().line(until_ns)


def starved(**how):
    machine = Starved(to_line(ScenarioStarted("bench")), to_line(SENT), FINISHED, **how)
    return follow(machine, "bench")[0].verdict


def test_a_machine_slowed_by_a_busy_host_has_not_hung():
    assert starved(silences=8) is Verdict.PASSED


def test_a_machine_has_hung_once_it_used_its_processor_time():
    assert starved(silences=12) is Verdict.HUNG


def test_a_machine_that_uses_no_processor_time_has_hung():
    assert starved(silences=2, share=0.001) is Verdict.HUNG
