import contextlib
import io
import os
import subprocess
import sys

import numpy as np
import pytest

from experiments.operator.console import Console
from experiments.operator.feedback import (
    FeedbackSignal,
    OperatorFeedback,
    SpeechOutput,
    build_feedback,
    find_speech,
)
from experiments.run.trial import PACE_LIMIT, PaceMonitor
from experiments.settings.rig import OperatorSection


class Terminal(io.StringIO):
    """A standard output that is a terminal."""

    def isatty(self):
        return True


class Words:
    """A speaker that only records its words."""

    def __init__(self):
        self.spoken = []
        self.is_closed = False

    def say(self, words):
        self.spoken.append(words)

    def close(self):
        self.is_closed = True


def heard(stream, *, bell=True):
    with contextlib.redirect_stdout(stream):
        feedback = build_feedback(OperatorSection(bell=bell), Console())
        for cue in FeedbackSignal:
            feedback.give(cue)
    return stream.getvalue()


def test_start_too_fast_and_done_ring_differently():
    assert heard(Terminal()) == "\a" + "\a\a\a" + "\a\a"


def test_without_a_terminal_nothing_rings():
    assert heard(io.StringIO()) == ""


def test_the_bell_can_be_switched_off():
    assert heard(Terminal(), bell=False) == ""


def test_cues_are_spoken_in_fixed_words_and_end_with_the_session():
    words = Words()
    feedback = OperatorFeedback(Console(), words, has_sound=False)
    for cue in FeedbackSignal:
        feedback.give(cue)
    feedback.close()
    assert words.spoken == ["recording", "slower", "done"]
    assert words.is_closed


def test_cues_are_spoken_only_if_set(monkeypatch):
    monkeypatch.setattr(
        "experiments.operator.feedback.find_speech", lambda: "/bin/speak"
    )
    started = []

    def start(command, **_):
        started.append(command)
        raise OSError

    monkeypatch.setattr(subprocess, "Popen", start)
    build_feedback(OperatorSection(), Console()).give(FeedbackSignal.DONE)
    assert started == []
    build_feedback(OperatorSection(speech=True), Console()).give(FeedbackSignal.DONE)
    assert started == [("/bin/speak", "done")]


@pytest.mark.parametrize(
    ("installed", "path"),
    [
        ({"say", "espeak"}, "/bin/espeak"),
        ({"espeak-ng", "spd-say"}, "/bin/spd-say"),
        ({"espeak-ng", "espeak"}, "/bin/espeak-ng"),
        (set(), None),
    ],
)
def test_the_first_installed_speech_program_is_used(installed, path):
    assert find_speech(lambda n: f"/bin/{n}" if n in installed else None) == path


@pytest.fixture
def program(tmp_path):
    """A program that writes down its words and its session, and keeps running."""
    path = tmp_path / "speak"
    path.write_text(
        f"#!{sys.executable}\nimport os, sys, time\n"
        f"with open({str(tmp_path / 'spoken')!r}, 'w') as file:\n"
        "    file.write(f'{os.getsid(0) == os.getpid()} {sys.argv[1:]}')\n"
        "print('heard', flush=True)\ntime.sleep(60)\n"
    )
    path.chmod(0o755)
    return path


@pytest.fixture
def started(monkeypatch):
    """The speech programs that are started during the test."""
    programs = []
    usual = subprocess.Popen

    def start(command, **options):
        programs.append(usual(command, **options))
        return programs[-1]

    monkeypatch.setattr(subprocess, "Popen", start)
    return programs


def test_words_reach_the_program_without_a_shell_in_its_own_session(
    program, tmp_path, monkeypatch
):
    started = []
    usual = subprocess.Popen

    def start(command, **options):
        started.append(usual(command, **{**options, "stdout": subprocess.PIPE}))
        return started[-1]

    monkeypatch.setattr(subprocess, "Popen", start)
    speech = SpeechOutput(str(program))
    speech.say("slower; touch /tmp/x")
    with started[0].stdout as heard:
        assert heard.readline() == b"heard\n"
    speech.close()
    assert (tmp_path / "spoken").read_text() == "True ['slower; touch /tmp/x']"
    assert started[0].returncode == -9  # ended, not waited for


def test_new_words_end_the_old_ones(program, started):
    speech = SpeechOutput(str(program))
    speech.say("recording")
    speech.say("done")
    first, second = started
    assert first.returncode == -9
    assert second.poll() is None
    speech.close()
    speech.close()
    assert second.returncode == -9


def test_a_speech_program_that_cannot_start_raises_nothing(tmp_path, started):
    speech = SpeechOutput(str(tmp_path / "gone"))
    speech.say("recording")
    assert started == []
    assert os.listdir(tmp_path) == []  # noqa: PTH208


def too_fast(speeds, dt=0.02):
    watch = PaceMonitor()
    path = np.cumsum(np.array(speeds) * dt)
    return [i * dt for i, x in enumerate(path) if watch.is_too_fast(i * dt, float(x))]


def test_a_sustained_fast_push_is_reported_at_a_limited_rate():
    times = too_fast([0.25] * 200)
    assert times[0] == pytest.approx(1.02, abs=0.03)
    assert np.diff(times).min() > 1.0


def test_a_usual_push_with_slips_is_not_too_fast():
    slip = [0.0] * 20 + [0.4] * 4  # 32 mm in 80 ms, twice a second
    assert too_fast(slip * 20) == []


def test_a_push_is_too_fast_beyond_the_limit_only():
    assert too_fast([0.95 * PACE_LIMIT] * 200) == []
    assert too_fast([1.05 * PACE_LIMIT] * 200)
