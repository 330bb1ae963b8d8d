"""The table of verdicts on the terminal and in docs/lab.md."""

from lab.report import page, result_line, summary
from lab.results import ScenarioResult, Verdict

PASSED = ScenarioResult("bench", Verdict.PASSED, 3.5, {"rate": "500 Hz", "p|q": "1"})
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


def test_the_page_has_a_row_and_a_sentence_for_each_scenario():
    text = page([PASSED, FAILED], {"bench": "Measure the loop."}, 61.4)
    rows = [line for line in text.splitlines() if line.startswith("| ")]
    assert "| bench | passed | 3.5 | rate: 500 Hz; p\\|q: 1 |" in rows
    assert any("ValueError: no" in row for row in rows)
    assert "**bench**: Measure the loop." in text
