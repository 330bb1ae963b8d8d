"""Results cross the serial console as lines among the machine's own output."""

import pytest

from lab.results import (
    MARK,
    AllFinished,
    ScenarioResult,
    ScenarioStarted,
    Verdict,
    from_line,
    to_line,
)

RESULT = ScenarioResult(
    "session", Verdict.FAILED, 31.25, {"missed": "0"}, "exit code 4", "line\nline|2"
)


@pytest.mark.parametrize(
    "message", [RESULT, ScenarioStarted("session"), AllFinished(2.5)]
)
def test_a_message_round_trips_through_the_console(message):
    line = to_line(message)
    assert "\n" not in line
    assert from_line(line) == message


def test_a_kernel_message_before_the_mark_is_skipped():
    assert from_line("[    1.25] usb 1-1: new " + to_line(RESULT)) == RESULT


@pytest.mark.parametrize(
    "line",
    [
        "",
        "[    1.25] usb 1-1: new full-speed device",
        MARK + "{",
        MARK + "[1]",
        MARK + '{"kind": "Nothing"}',
        MARK + '{"kind": "ScenarioStarted"}',
        MARK + '{"kind": "ScenarioResult", "name": "a", "verdict": "fine"}',
        to_line(RESULT)[:-20],
    ],
)
def test_other_lines_are_not_messages(line):
    assert from_line(line) is None


@pytest.mark.parametrize(
    ("verdict", "is_fine"),
    [
        (Verdict.PASSED, True),
        (Verdict.EXPECTED, True),
        (Verdict.FAILED, False),
        (Verdict.HUNG, False),
        (Verdict.SURPRISING, False),
    ],
)
def test_only_passed_and_expected_verdicts_are_fine(verdict, is_fine):
    assert verdict.is_fine is is_fine
