"""Ctrl-C, once and twice, ends every phase of a session with the arm at rest."""

import signal
from dataclasses import dataclass

import pytest

from acquisition.devices import SafetyMode
from experiments.operator.prompts import Prompt
from experiments.session.reducer import replay
from experiments.session.states import OPEN, Event, SessionPhase
from tests.experiments.program import (
    journal,
    kept_and_sound,
    only_session,
    run_watched,
    traction,
)

pytestmark = pytest.mark.slow


@dataclass(frozen=True)
class Moment:
    """When Ctrl-C comes, and how the session ends.

    Attributes:
        prompt: prompt at which Ctrl-C comes.
        phase: phase of the session in the journal at that moment.
        code: exit code.
        end: phase of the session afterwards.
        rejected: number of rejected attempts.
        trial: number of the trial; 0 is the tare at the end.
    """

    prompt: Prompt
    phase: SessionPhase
    code: int = 5
    end: SessionPhase = SessionPhase.UNFINISHED
    rejected: int = 0
    trial: int = 1


MOMENTS = [
    Moment(Prompt.SUPPORT, SessionPhase.PREFLIGHT, trial=0),
    Moment(Prompt.LIFT, SessionPhase.READY),
    Moment(Prompt.READY, SessionPhase.READY),
    Moment(Prompt.NOTE, SessionPhase.READY),
    Moment(Prompt.PAUSED, SessionPhase.PAUSED),
    Moment(Prompt.RECORDING, SessionPhase.RECORDING, rejected=1),
    Moment(Prompt.REVIEW, SessionPhase.REVIEW, rejected=1),
    Moment(Prompt.LIFT, SessionPhase.READY, 0, SessionPhase.COMPLETE, trial=0),
]
_KEY_TO_PROMPT = {Prompt.NOTE: "n", Prompt.PAUSED: "p"}


def interrupt(moment, times, seen):
    """A `press` that raises Ctrl-C and records the phase of that moment."""
    hit = []

    def press(asked, rig):
        is_moment = (asked.prompt, asked.trial) == (moment.prompt, moment.trial)
        if is_moment and not hit:
            if asked.since <= 0.05:
                return ""
            hit.append(True)
            seen.append(replay(journal(only_session(seen[0]))).phase)
            for _ in range(times):
                signal.raise_signal(signal.SIGINT)
            return ""
        if asked.prompt is Prompt.READY:
            return _KEY_TO_PROMPT.get(moment.prompt, " ") if asked.since > 0.05 else ""
        if asked.prompt is Prompt.RECORDING:
            return " " if asked.since > 0.2 else ""
        if asked.prompt is Prompt.REVIEW:
            return "k" if asked.since > 0.1 else ""
        return None

    return press


@pytest.mark.parametrize("times", [1, 2])
@pytest.mark.parametrize("moment", MOMENTS, ids=lambda m: f"{m.prompt.value}{m.trial}")
def test_ctrl_c_ends_every_phase_with_the_arm_at_rest(
    config, tmp_path, monkeypatch, moment, times
):
    seen = [tmp_path]
    press = interrupt(moment, times, seen)

    def line(keys, asked):
        press(asked, None)

    monkeypatch.setattr("experiments.operator.auto_operator.AutoOperator.line", line)
    session = run_watched(config, tmp_path, 1, press=press)
    events, state = journal(session.folder), replay(journal(session.folder))
    assert seen[1:] == [moment.phase]  # once, in the intended phase
    assert session.done.code == moment.code
    assert events[-1]["event"] == Event.ENDED
    assert (state.phase, state.rejected) == (moment.end, moment.rejected)
    assert state.running is None
    assert session.rig.network.safety_mode is SafetyMode.IDLE
    assert session.rig.plant.is_idle
    assert "ARM: idle; it sinks slowly, support it." in session.done.out.splitlines()
    assert session.done.err == ""
    assert not list(session.folder.rglob("*.partial"))
    assert len(kept_and_sound(session.folder)) == len(state.kept)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_every_open_phase_is_interrupted():
    assert {moment.phase for moment in MOMENTS} == OPEN


@pytest.mark.parametrize("times", [1, 2])
def test_ctrl_c_in_a_preflight_creates_no_data(config, tmp_path, monkeypatch, times):
    def interrupted(*_):
        for _ in range(times):
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr("experiments.preflight.preflight.check_code", interrupted)
    options = ("--fake", "--fast", "--operator-script", "auto", "--config", config)
    done = traction("run", "TF", *options, "--data", tmp_path / "data")
    assert done.code == 130
    assert done.err == "Interrupted. Nothing recorded is lost.\n"
    assert not (tmp_path / "data").exists()
