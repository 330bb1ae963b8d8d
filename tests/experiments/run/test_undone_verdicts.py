"""A verdict is repeated on the screen and can be undone for a limited time."""

import json

import pytest

from acquisition.control_loop.faults import Action, Fault, GuardVerdict
from acquisition.errors import DeviceFaultError
from experiments.operator.auto_operator import AutoOperator
from experiments.operator.keys import REJECT_REASONS
from experiments.operator.prompts import Prompt
from experiments.run.console_loop import TICK
from experiments.run.context import UNDO_NS
from experiments.run.ready import wait_ready
from experiments.run.stop import StopRequestedError, UndoRequestedError
from experiments.run.verdicts import ask_verdict, await_undo, judge_again
from experiments.session.reducer import replay
from experiments.session.sidecar import TrialName, TrialOutcome
from experiments.session.states import Event
from tests.experiments.program import (
    journal,
    only_session,
    run_short,
    run_watched,
    sidecar,
)
from tests.experiments.run.bench import Keys, make_context

FIRST = TrialName(1, 1)


def judged(data, *keys, opening=None):
    """Context after the first trial got its verdict with `keys[0]`."""
    context = make_context(data, Keys(*keys))
    if opening is not None:
        context.journal.append(Event.ENDED, reason="unfinished")
        context.journal.append(opening, trial=1, reason="worn")
        context.journal.append(Event.ACTIVATED)
    details = {"trial": 1, "attempt": 1}
    context.journal.append(Event.TRIAL_STARTED, **details)
    context.journal.append(Event.TRIAL_RECORDED, **details)
    trials = context.metadata.folder.trials
    (trials / "T01.mcap").write_bytes(b"recording")
    (trials / "T01.json").write_text(json.dumps(details))
    ask_verdict(context, FIRST, TrialOutcome("travel", 3.0, 0.4))
    return context


def press_undo(context, prompt=Prompt.LIFT):
    """Press the undo key at `prompt`, then judge again."""
    with pytest.raises(UndoRequestedError):
        context.console_loop.tick(prompt, FIRST)
    judge_again(context)


def test_a_verdict_is_repeated_with_the_key_that_undoes_it(tmp_path, capsys):
    judged(tmp_path, "k")
    assert "T01 kept. [u] within 10 s takes this back." in capsys.readouterr().out


def test_an_undone_keep_can_become_a_rejection_that_moves_the_files(tmp_path, capsys):
    context = judged(tmp_path, "k", "u", "r2")
    press_undo(context)
    state, folder = context.journal.state, context.metadata.folder
    assert (state.kept, state.rejected, state.next_trial) == ((), 1, 1)
    assert (folder.rejected / "T01a.mcap").read_bytes() == b"recording"
    assert not (folder.trials / "T01.mcap").exists()
    fields = sidecar(folder.rejected / "T01a.json")
    assert (fields["verdict"], fields["reason"]) == ("reject", REJECT_REASONS["2"])
    assert [old["verdict"] for old in fields["history"]] == ["keep"]
    assert "T01 rejected: too fast" in capsys.readouterr().out


def test_an_undone_rejection_can_become_a_keep(tmp_path):
    context = judged(tmp_path, "r4", "u", "k")
    press_undo(context)
    state, folder = context.journal.state, context.metadata.folder
    assert (state.kept, state.rejected, state.next_trial) == ((1,), 0, 2)
    assert (folder.trials / "T01.mcap").read_bytes() == b"recording"
    assert replay(folder.events()) == state


def test_the_new_verdict_can_be_undone_too(tmp_path):
    context = judged(tmp_path, "k", "u", "r2", "u", "k")
    press_undo(context)
    press_undo(context)
    assert context.journal.state.kept == (1,)
    kinds = [event["event"] for event in context.metadata.folder.events()]
    assert kinds[-3:] == ["trial-kept", "verdict-changed", "verdict-changed"]


def test_the_same_verdict_again_changes_nothing(tmp_path):
    context = judged(tmp_path, "k", "u", "k")
    before = context.metadata.folder.events()
    press_undo(context)
    assert context.metadata.folder.events() == before


def test_quit_while_judging_again_leaves_the_first_verdict(tmp_path):
    context = judged(tmp_path, "k", "u", "q")
    with pytest.raises(StopRequestedError):
        press_undo(context)
    assert context.journal.state.kept == (1,)
    assert (context.metadata.folder.trials / "T01.mcap").exists()


def test_a_verdict_cannot_be_undone_after_the_time_limit(tmp_path, capsys):
    context = judged(tmp_path, "k", *[""] * round(UNDO_NS * 1e-9 / TICK), "u")
    while context.operator.keys:
        context.console_loop.tick(Prompt.LIFT, FIRST)
    assert "No verdict to take back" in capsys.readouterr().out
    assert context.journal.state.kept == (1,)


def test_the_undo_key_does_nothing_before_the_first_verdict(tmp_path, capsys):
    wait_ready(make_context(tmp_path, Keys("u", " ")), FIRST)
    assert "No verdict to take back" in capsys.readouterr().out


@pytest.mark.slow
def test_a_script_undoes_a_verdict_in_a_whole_session(tmp_path, config):
    script = tmp_path / "script.txt"
    script.write_text("keep\nundo\nredo 2\nkeep\n")
    done = run_short(config, tmp_path / "data", "TF", 1, "--operator-script", script)
    assert done.code == 0, done.err
    folder = only_session(tmp_path / "data")
    verdicts = [
        e for e in journal(folder) if e["event"] in {"trial-kept", "verdict-changed"}
    ]
    assert [(e["event"], e["attempt"]) for e in verdicts] == [
        ("trial-kept", 1),
        ("verdict-changed", 1),
        ("trial-kept", 2),
    ]
    assert {e["who"] for e in verdicts} == {"script"}
    assert sorted(p.name for p in (folder / "trials").glob("*.mcap"))[0] == "T01.mcap"
    assert (folder / "rejected" / "T01a.mcap").exists()
    assert "T01 kept: this stands until you give another verdict." in done.out


def broken():
    """Fail like a loop whose process died."""
    raise DeviceFaultError("The recorder ended.")


def test_a_fault_at_the_end_is_reported_once_and_does_not_end_undo(tmp_path, capsys):
    context = judged(tmp_path, "k", "", "", "", "u")
    context.loop_client.status.verdict = GuardVerdict(Action.IDLE, Fault.E_STOP)
    with pytest.raises(UndoRequestedError):
        await_undo(context)
    assert capsys.readouterr().out.count("▲ Stop pressed") == 1


def test_a_device_failure_at_the_end_is_reported_and_ends_the_wait(tmp_path, capsys):
    context = judged(tmp_path, "k")
    context.loop_client.on_advance.append(broken)
    await_undo(context)
    assert "▲ The recorder ended." in capsys.readouterr().out
    assert context.console_loop.undo_left > 0.0


@pytest.mark.parametrize("key", [" ", "q"])
def test_another_key_ends_the_wait_for_undo(tmp_path, key):
    context = judged(tmp_path, "k", key)
    await_undo(context)
    assert UNDO_NS * 1e-9 - context.console_loop.undo_left < 2.0 * TICK


@pytest.mark.slow
def test_a_person_can_undo_the_last_verdict(tmp_path, config, monkeypatch):
    monkeypatch.setattr(AutoOperator, "who", "mk")
    pressed = []

    def press(asked, _):
        if asked.prompt is Prompt.UNDO:
            pressed.append("u" if len(pressed) < 1 else " ")
            return pressed[-1]
        is_again = asked.prompt is Prompt.REVIEW and len(pressed) == 1
        return "r2" if is_again and asked.attempt == 1 else None

    watched = run_watched(config, tmp_path / "data", 1, press=press)
    assert watched.done.code == 0, watched.done.err
    verdicts = [
        e for e in journal(watched.folder) if "verdict" in e or "kept" in e["event"]
    ]
    assert [(e["event"], e["attempt"], e["who"]) for e in verdicts] == [
        ("trial-kept", 1, "mk"),
        ("verdict-changed", 1, "mk"),
        ("trial-kept", 2, "mk"),
    ]
    assert pressed == ["u", " "]
