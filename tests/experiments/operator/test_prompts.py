import io
import sys

import pytest

from acquisition.errors import SettingsError
from experiments.operator.auto_operator import (
    AUTO_ATTEMPTS,
    AUTO_PATIENCE,
    AutoOperator,
)
from experiments.operator.prompts import Prompt, PromptState
from experiments.operator.scripted import choose_operator
from experiments.operator.terminal import TerminalInput
from experiments.rig.simulation import SimulatedHand
from experiments.run.fault_plan import FaultPlan, parse_fault

KNOWN = ("ft-stale", "ft-silent", "estop")


def asked(prompt, *, attempt=1, is_complete=False, since=0.0):
    return PromptState(prompt, 1, attempt, is_complete, since)


@pytest.mark.parametrize(
    ("question", "key"),
    [
        (asked(Prompt.SUPPORT), " "),
        (asked(Prompt.LIFT), ""),
        (asked(Prompt.LIFT, since=AUTO_PATIENCE + 0.1), "q"),
        (asked(Prompt.READY, since=2.0), ""),
        (asked(Prompt.READY, since=2.3), " "),
        (asked(Prompt.RECORDING, since=9.0), ""),
        (asked(Prompt.REVIEW, is_complete=True, attempt=AUTO_ATTEMPTS), "k"),
        (asked(Prompt.REVIEW), "r5"),
        (asked(Prompt.REVIEW, attempt=AUTO_ATTEMPTS), "q"),
    ],
)
def test_the_automatic_operator_presses_the_expected_key(question, key):
    assert AutoOperator().answer(question) == key


def test_the_simulated_hand_acts_once_per_prompt():
    done = []

    class Recorder:
        def __getattr__(self, name):
            return lambda *arguments: done.append((name, *arguments))

    hand = SimulatedHand(Recorder())
    for prompt in (Prompt.LIFT, Prompt.LIFT, Prompt.READY, Prompt.READY):
        hand.follow(PromptState(prompt, 2, 3, False, 0.0))
    hand.follow(PromptState(Prompt.RECORDING, 2, 3, False, 0.0))
    hand.follow(PromptState(Prompt.REVIEW, 2, 3, True, 0.0))
    assert done == [("lift",), ("prepare", 2002), ("put_down",), ("push",), ("rest",)]


@pytest.mark.parametrize("stdin", [None, io.StringIO()])
def test_a_simulation_without_a_terminal_runs_by_itself(monkeypatch, stdin):
    monkeypatch.setattr(sys, "stdin", stdin)
    assert isinstance(choose_operator(None, is_fake=True), AutoOperator)


@pytest.mark.parametrize("stdin", [None, io.StringIO()])
def test_a_real_session_needs_a_terminal(monkeypatch, stdin):
    monkeypatch.setattr(sys, "stdin", stdin)
    with pytest.raises(SettingsError, match="needs a person at a terminal"):
        choose_operator(None, is_fake=False)


def test_a_person_at_a_terminal_is_asked(monkeypatch):
    terminal = io.StringIO()
    terminal.isatty = lambda: True
    terminal.fileno = lambda: 99
    monkeypatch.setattr(sys, "stdin", terminal)
    assert isinstance(choose_operator(None, is_fake=False), TerminalInput)


@pytest.mark.parametrize(
    ("text", "plan"),
    [
        ("ft-stale@T3+1.5s", FaultPlan("ft-stale", 3, 1.5)),
        ("estop@T1+2", FaultPlan("estop", 1, 2.0)),
        ("estop", FaultPlan("estop", 1, 2.0)),
        ("ft-silent", FaultPlan("ft-silent", 0, 0.0)),
    ],
)
def test_a_fault_is_planned_as_written(text, plan):
    assert parse_fault(text, KNOWN) == plan


@pytest.mark.parametrize("text", ["", "estop@", "estop@T+1s", "estop@T1-1s", "flood"])
def test_a_malformed_fault_is_refused(text):
    with pytest.raises(SettingsError, match="is not a fault that can be raised"):
        parse_fault(text, KNOWN)
