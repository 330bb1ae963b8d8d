"""Verdicts are shown as lines on the terminal."""

from lab.report import missed_cycles_line, result_line, summary
from lab.results import ScenarioResult, Verdict

PASSED = ScenarioResult(
    "bench", Verdict.PASSED, 3.5, {"rate": "500 Hz"}, processor=41.2
)
FAILED = ScenarioResult(
    "session", Verdict.FAILED, 1.0, {}, "Traceback\n  line\nValueError: no"
)


def test_a_passed_scenario_shows_its_figures():
    line = result_line(PASSED)
    assert line.startswith("passed")
    assert "rate: 500 Hz" in line
    assert "3.50 s" in line


def test_a_failed_scenario_shows_the_last_line_of_its_reason():
    line = result_line(FAILED)
    assert "ValueError: no" in line
    assert "Traceback" not in line


def test_the_summary_counts_each_verdict():
    text = summary([PASSED, FAILED, PASSED], 61.4)
    assert "2 passed" in text
    assert "1 failed" in text
    assert "61 s" in text


def kept(cycles, missed):
    figures = {"cycles": str(cycles), "missed": str(missed)}
    return ScenarioResult("session", Verdict.PASSED, 1.0, figures)


def test_cycles_of_all_scenarios_are_added_up():
    words = missed_cycles_line([kept(60_000, 0), PASSED, kept(40_000, 2)])
    assert "2 of 100000" in words
    assert "20 ppm" in words


def test_without_a_missed_cycle_the_bound_follows_from_their_number():
    # Of 3 / n misses a cycle, 95 % of all runs of n cycles would show one.
    assert "below 30 ppm" in missed_cycles_line([kept(100_000, 0)])


def test_without_trials_no_missed_cycles_are_reported():
    assert "ppm" not in missed_cycles_line([PASSED])
