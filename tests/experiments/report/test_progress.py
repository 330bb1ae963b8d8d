import re

import pytest

from experiments.report.progress import ProgressLine, progress_text


class RecordingConsole:
    """Console that records its output, with or without a terminal."""

    def __init__(self, *, is_live=False):
        self.is_live, self.lines, self.panels, self.ended = is_live, [], [], 0

    def say(self, text):
        self.lines.append(text)

    def panel(self, lines):
        self.panels.append(lines)

    def end_panel(self):
        self.ended += 1


class Now:
    """Clock that the test sets."""

    t = 0.0

    def now_ns(self):
        return int(self.t * 1e9)


def test_the_progress_text_shows_count_and_remaining_time():
    assert progress_text(40, 80, 65.4, "fits").endswith("40 of 80 fits, 1 min 5 s left")
    assert progress_text(40, 80, 9.6, "fits").endswith("40 of 80 fits, 10 s left")
    assert progress_text(80, 80, 0.0, "fits").endswith("80 of 80 fits")
    assert progress_text(40, 80, None, "fits").startswith("━" * 15 + "─" * 15)


def test_without_a_terminal_a_line_is_printed_at_every_tenth():
    console, clock = RecordingConsole(), Now()
    line = ProgressLine(console, clock, "fits")
    for k in range(1, 101):
        clock.t = 0.5 * k
        line(k, 100)
    assert 9 <= len(console.lines) <= 11
    assert console.lines[-1].endswith("100 of 100 fits")
    assert console.panels == []


def test_results_of_an_earlier_run_do_not_count_for_the_pace():
    console, clock = RecordingConsole(is_live=True), Now()
    line = ProgressLine(console, clock, "fits")
    line(60, 100)
    for k in range(10):
        clock.t = 5.0 + k
        line(61 + k, 100)
    assert "70 of 100 fits, 30 s left" in console.panels[-1][0]
    line.end()
    assert console.ended == 1


@pytest.mark.parametrize("abreast", [1, 2, 4, 16])
@pytest.mark.parametrize("startup", [0.0, 3.0])
def test_the_time_left_is_right_once_it_is_told(abreast, startup):
    """Items of 1 s, computed several at a time by processes that start up first."""
    console, clock = RecordingConsole(is_live=True), Now()
    line = ProgressLine(console, clock, "fits", abreast)
    for k in range(160):
        clock.t = startup + 1.0 + k // abreast + 0.01 * (k % abreast)
        line(k + 1, 160)
        text = console.panels[-1][0]
        seconds = [float(n) for n in re.findall(r" (\d+) s left", text)]
        minutes = [60.0 * float(n) for n in re.findall(r" (\d+) min", text)]
        if k >= 16 and k < 159:
            true = (160 - k - 1) / abreast
            assert sum(minutes + seconds) == pytest.approx(true, rel=0.3, abs=1.5)
        elif k < abreast:
            assert "left" not in text
