"""A verdict is repeated on the screen and can be taken back for ten seconds."""

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
    """Return the context after a first trial got its verdict with `keys[0]`."""
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


def waits(context, prompt=Prompt.LIFT):
    """Let the undo key be pressed while `prompt` is asked."""
    with pytest.raises(UndoRequestedError):
        context.console_loop.tick(prompt, FIRST)
    judge_again(context)


def test_a_verdict_is_repeated_and_says_how_it_is_taken_back(tmp_path, capsys):
    judged(tmp_path, "k")
    assert "T01 kept. [u] within 10 s takes this back." in capsys.readouterr().out


def test_a_kept_trial_becomes_a_rejected_one_and_its_files_follow(tmp_path, capsys):
    context = judged(tmp_path, "k", "u", "r2")
    waits(context)
    state, folder = context.journal.state, context.metadata.folder
    assert (state.kept, state.rejected, state.next_trial) == ((), 1, 1)
    assert (folder.rejected / "T01a.mcap").read_bytes() == b"recording"
    assert not (folder.trials / "T01.mcap").exists()
    fields = sidecar(folder.rejected / "T01a.json")
    assert (fields["verdict"], fields["reason"]) == ("reject", REJECT_REASONS["2"])
    assert [old["verdict"] for old in fields["history"]] == ["keep"]
    assert "T01 rejected: too fast" in capsys.readouterr().out


def test_a_rejected_trial_becomes_a_kept_one(tmp_path):
    context = judged(tmp_path, "r4", "u", "k")
    waits(context)
    state, folder = context.journal.state, context.metadata.folder
    assert (state.kept, state.rejected, state.next_trial) == ((1,), 0, 2)
    assert (folder.trials / "T01.mcap").read_bytes() == b"recording"
    assert replay(folder.events()) == state


def test_the_new_verdict_can_be_taken_back_too(tmp_path):
    context = judged(tmp_path, "k", "u", "r2", "u", "k")
    waits(context)
    waits(context)
    assert context.journal.state.kept == (1,)
    kinds = [event["event"] for event in context.metadata.folder.events()]
    assert kinds[-3:] == ["trial-kept", "verdict-changed", "verdict-changed"]


def test_the_same_verdict_again_changes_nothing(tmp_path):
    context = judged(tmp_path, "k", "u", "k")
    before = context.metadata.folder.events()
    waits(context)
    assert context.metadata.folder.events() == before


def test_a_session_that_ends_while_it_is_judged_again_keeps_what_was_given(tmp_path):
    context = judged(tmp_path, "k", "u", "q")
    with pytest.raises(StopRequestedError):
        waits(context)
    assert context.journal.state.kept == (1,)
    assert (context.metadata.folder.trials / "T01.mcap").exists()


def test_a_repeated_trial_whose_verdict_is_taken_back_is_to_be_repeated_again(
    tmp_path,
):
    context = make_context(tmp_path, Keys("k"))
    details = {"trial": 1, "attempt": 1}
    context.journal.append(Event.TRIAL_STARTED, **details)
    context.journal.append(Event.TRIAL_RECORDED, **details)
    context.journal.append(Event.TRIAL_KEPT, **details)
    context.journal.append(Event.ENDED, reason="unfinished")
    context.journal.append(Event.REDO, trial=1, reason="worn")
    context.journal.append(Event.ACTIVATED)
    context.journal.append(Event.SET_ASIDE, trial=1, attempt=1)
    second = {"trial": 1, "attempt": 2}
    context.journal.append(Event.TRIAL_STARTED, **second)
    context.journal.append(Event.TRIAL_RECORDED, **second)
    context.journal.append(Event.TRIAL_KEPT, **second)
    assert context.journal.state.is_over
    context.journal.append(Event.VERDICT, **second, verdict="reject", reason="r")
    assert (context.journal.state.is_over, context.journal.state.redoing) == (False, 1)
    context.journal.append(Event.VERDICT, **second, verdict="keep", reason="r")
    assert context.journal.state.is_over


def test_after_ten_seconds_nothing_is_taken_back(tmp_path, capsys):
    context = judged(tmp_path, "k", *[""] * round(UNDO_NS * 1e-9 / TICK), "u")
    while context.operator.keys:
        context.console_loop.tick(Prompt.LIFT, FIRST)
    assert "No verdict to take back" in capsys.readouterr().out
    assert context.journal.state.kept == (1,)


def test_before_the_first_verdict_the_key_means_nothing(tmp_path, capsys):
    wait_ready(make_context(tmp_path, Keys("u", " ")), FIRST)
    assert "No verdict to take back" in capsys.readouterr().out


@pytest.mark.slow
def test_a_script_takes_a_verdict_back_in_a_whole_session(tmp_path, config):
    script = tmp_path / "script.txt"
    script.write_text("keep\nundo\nredo 2\nkeep\n")
    done = run_short(config, tmp_path / "data", "TF", 1, "--operator-script", script)
    assert done.code == 0, done.err
    folder = only_session(tmp_path / "data")
    told = [
        e for e in journal(folder) if e["event"] in {"trial-kept", "verdict-changed"}
    ]
    assert [(e["event"], e["attempt"]) for e in told] == [
        ("trial-kept", 1),
        ("verdict-changed", 1),
        ("trial-kept", 2),
    ]
    assert {e["who"] for e in told} == {"script"}
    assert sorted(p.name for p in (folder / "trials").glob("*.mcap"))[0] == "T01.mcap"
    assert (folder / "rejected" / "T01a.mcap").exists()
    assert "T01 kept: this stands until you give another verdict." in done.out


def broken():
    """Fail as a loop does whose process died."""
    raise DeviceFaultError("The recorder ended.")


def test_a_fault_at_the_end_is_told_once_and_takes_no_time_from_undo(tmp_path, capsys):
    context = judged(tmp_path, "k", "", "", "", "u")
    context.loop_client.status.verdict = GuardVerdict(Action.IDLE, Fault.E_STOP)
    with pytest.raises(UndoRequestedError):
        await_undo(context)
    assert capsys.readouterr().out.count("▲ Stop pressed") == 1


def test_what_fails_at_the_end_is_told_and_ends_the_wait(tmp_path, capsys):
    context = judged(tmp_path, "k")
    context.loop_client.on_advance.append(broken)
    await_undo(context)
    assert "▲ The recorder ended." in capsys.readouterr().out
    assert context.console_loop.undo_left > 0.0


@pytest.mark.parametrize("key", [" ", "q"])
def test_a_key_ends_the_wait_at_the_end(tmp_path, key):
    context = judged(tmp_path, "k", key)
    await_undo(context)
    assert UNDO_NS * 1e-9 - context.console_loop.undo_left < 2.0 * TICK


@pytest.mark.slow
def test_a_person_can_take_the_last_verdict_back(tmp_path, config, monkeypatch):
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
    told = [
        e for e in journal(watched.folder) if "verdict" in e or "kept" in e["event"]
    ]
    assert [(e["event"], e["attempt"], e["who"]) for e in told] == [
        ("trial-kept", 1, "mk"),
        ("verdict-changed", 1, "mk"),
        ("trial-kept", 2, "mk"),
    ]
    assert pressed == ["u", " "]
