"""The steps of the flow that ask the operator: ready, note, verdict, estimates."""

import time
from dataclasses import replace
from types import SimpleNamespace

import pytest

from acquisition.control_loop.faults import Action, Fault, GuardVerdict
from acquisition.control_loop.states import ArmState
from experiments.operator.keys import NOTE_KEYS, REJECT_REASONS, screen_keys
from experiments.operator.prompts import Prompt
from experiments.run import ready
from experiments.run.console_loop import TICK
from experiments.run.ready import ready_view, wait_ready
from experiments.run.stop import ArmFaultError, StopRequestedError
from experiments.run.verdicts import ask_verdict, take_note
from experiments.session.sidecar import TrialName, TrialOutcome
from experiments.session.states import Event
from tests.experiments.run.bench import Keys, make_context

FIRST = TrialName(1, 1)


def names(context):
    return [event["event"] for event in context.metadata.folder.events()]


def reviewed(context):
    """Record the first trial and leave it waiting for its verdict."""
    details = {"trial": 1, "attempt": 1}
    context.journal.append(Event.TRIAL_STARTED, **details)
    context.journal.append(Event.TRIAL_RECORDED, **details)
    return TrialOutcome("key", 3.0, 0.4)


def test_a_trial_begins_with_space_and_with_no_other_key(tmp_path):
    context = make_context(tmp_path, Keys("x", "k", "", " ", "n"))
    wait_ready(context, FIRST)
    assert context.operator.keys == ["n"]


@pytest.mark.parametrize(
    ("keys", "ticked"), [("1", {1}), ("13", {1, 3}), ("131", {3}), ("1331", set())]
)
def test_a_digit_ticks_or_unticks_a_step_of_the_reset(tmp_path, keys, ticked):
    context = make_context(tmp_path, Keys(*keys, " "))
    wait_ready(context, FIRST)
    assert ready_view(context).ticked == ticked


def test_quit_makes_the_next_trial_the_last(tmp_path):
    context = make_context(tmp_path, Keys("q", " "))
    wait_ready(context, FIRST)
    assert context.state.is_last


def test_quit_twice_ends_at_once(tmp_path):
    context = make_context(tmp_path, Keys("q", "q"))
    with pytest.raises(StopRequestedError):
        wait_ready(context, FIRST)


def test_the_thinnest_cell_is_shown(tmp_path, monkeypatch):
    monkeypatch.setattr(ready, "thinnest_cell", lambda folder: "slowly")
    context = make_context(tmp_path, Keys())
    assert ready_view(context).thin == "slowly"


def test_a_pause_holds_the_arm_and_is_in_the_journal(tmp_path):
    keys = Keys("p", "", "x", " ", " ")
    context = make_context(tmp_path, keys)
    wait_ready(context, FIRST)
    assert keys.keys == []  # it went on at the first space, not before
    assert context.loop_client.requested == [ArmState.HOLD, ArmState.FLOAT]
    assert names(context)[-2:] == [Event.PAUSED, Event.CONTINUED]


def test_there_is_nothing_to_view_before_the_first_trial(tmp_path, capsys):
    wait_ready(make_context(tmp_path, Keys("v", " ")), FIRST)
    assert "no trial to look at" in capsys.readouterr().out


def test_a_blank_note_is_ignored(tmp_path):
    context = make_context(tmp_path, Keys(lines=["   "]))
    take_note(context, FIRST, is_on_trial=False)
    assert Event.NOTED not in names(context)


def test_a_note_is_in_the_journal_with_its_author(tmp_path):
    context = make_context(tmp_path, Keys(lines=[None, "wet"]))
    take_note(context, FIRST, is_on_trial=False)
    (note,) = [e for e in context.metadata.folder.events() if e["event"] == "noted"]
    assert (note["text"], note["who"]) == ("wet", "mk")


def test_a_note_on_a_trial_names_trial_and_attempt(tmp_path):
    context = make_context(tmp_path, Keys(lines=["tilted"]))
    take_note(context, TrialName(1, 2), is_on_trial=True)
    (note,) = [e for e in context.metadata.folder.events() if e["event"] == "noted"]
    assert (note["trial"], note["attempt"]) == (1, 2)
    assert (note["text"], note["who"]) == ("tilted", "mk")


def test_a_kept_trial_counts(tmp_path):
    context = make_context(tmp_path, Keys("x", "r", "k"))
    ask_verdict(context, FIRST, reviewed(context))
    assert context.journal.state.kept == (1,)


@pytest.mark.parametrize("digit", REJECT_REASONS)
def test_a_rejected_trial_has_its_reason(tmp_path, digit):
    context = make_context(tmp_path, Keys(f"r{digit}"))
    ask_verdict(context, FIRST, reviewed(context))
    event = context.metadata.folder.events()[-1]
    assert (event["event"], event["reason"]) == (
        Event.TRIAL_REJECTED,
        REJECT_REASONS[digit],
    )


def test_quit_at_the_review_asks_for_the_missing_verdict(tmp_path, capsys):
    context = make_context(tmp_path, Keys("q", "k"))
    ask_verdict(context, FIRST, reviewed(context))
    assert "T01 has no verdict yet" in capsys.readouterr().out
    assert context.journal.state.kept == (1,)
    assert context.state.is_last


def test_quit_twice_at_the_review_rejects_and_names_the_verdict_command(
    tmp_path, capsys
):
    context = make_context(tmp_path, Keys("q", "q"))
    with pytest.raises(StopRequestedError):
        ask_verdict(context, FIRST, reviewed(context))
    assert names(context)[-1] == Event.TRIAL_REJECTED
    out = capsys.readouterr().out
    assert "rejected/T01a.mcap" in out
    assert "traction verdict" in out


def test_a_fault_during_the_review_leaves_the_verdict_to_the_operator(tmp_path, capsys):
    context = make_context(tmp_path, Keys("k"))
    outcome = reviewed(context)
    context.loop_client.status.verdict = GuardVerdict(Action.HOLD, Fault.CONSOLE_SILENT)
    ask_verdict(context, FIRST, outcome)
    assert context.journal.state.kept == (1,)
    assert "ARM: holding" in capsys.readouterr().err


def test_an_emergency_stop_during_the_review_rejects_the_trial(tmp_path):
    context = make_context(tmp_path, Keys())
    outcome = reviewed(context)
    context.loop_client.status.verdict = GuardVerdict(Action.IDLE, Fault.E_STOP)
    with pytest.raises(ArmFaultError):
        ask_verdict(context, FIRST, outcome)
    assert names(context)[-1] == Event.TRIAL_REJECTED


def test_the_duration_is_estimated_once_with_the_first_kept_trial(tmp_path):
    context = make_context(tmp_path, Keys("k"), trials=3)
    context.update_estimate()
    assert context.state.estimate is None
    context.loop_client.advance(10.0)
    ask_verdict(context, FIRST, reviewed(context))
    context.update_estimate()
    estimate = context.state.estimate
    assert estimate == pytest.approx(3 * context.elapsed)
    context.loop_client.advance(10.0)
    context.update_estimate()
    assert context.state.estimate == estimate


def test_the_loop_advances_while_a_slow_disk_writes_the_journal(tmp_path):
    context = make_context(tmp_path, Keys(), is_stepped=False)
    client, journal = context.loop_client, context.journal

    class SlowJournal:
        """Journal that waits until the console has ticked three times."""

        def append(self, event, **details):
            deadline = time.monotonic() + 5.0  # noqa: TID251 - of a thread
            while client.advanced < 3 * TICK and time.monotonic() < deadline:  # noqa: TID251
                pass
            journal.append(event, **details)

    context = replace(context, journal=SlowJournal())
    context.append(Event.PAUSED)
    assert client.advanced >= 3 * TICK
    assert names(context)[-1] == Event.PAUSED


def test_a_note_prints_its_keys_and_its_text(tmp_path, capsys):
    context = make_context(tmp_path, Keys(lines=["wet"]))
    take_note(context, FIRST, is_on_trial=False)
    out = capsys.readouterr().out
    assert NOTE_KEYS in out
    assert f"Noted on {context.metadata.folder.id}: wet" in out


def test_a_note_between_two_trials_holds_the_arm(tmp_path):
    context = make_context(tmp_path, Keys("n", " ", lines=["wet"]))
    wait_ready(context, FIRST)
    assert context.loop_client.requested == [ArmState.HOLD, ArmState.FLOAT]
    assert Event.NOTED in names(context)


def test_the_last_kept_trial_is_viewed_before_a_new_one_exists(
    tmp_path, capsys, monkeypatch
):
    context = make_context(tmp_path, Keys("v", " "), trials=4)
    for number in (1, 2, 3):
        for event in (Event.TRIAL_STARTED, Event.TRIAL_RECORDED, Event.TRIAL_KEPT):
            context.journal.append(event, trial=number, attempt=1)
    (context.metadata.folder.trials / "T04.mcap").touch()  # without a verdict
    lines = SimpleNamespace(lines=lambda: [("✓", "sound")])
    reviewed_paths = []
    monkeypatch.setattr(
        ready, "review_trial", lambda path: reviewed_paths.append(path.stem) or lines
    )
    wait_ready(context, FIRST)
    assert reviewed_paths == ["T03"]
    assert "T03, recorded before:" in capsys.readouterr().out


def test_the_newest_page_is_viewed_again(tmp_path, capsys):
    context = make_context(tmp_path, Keys("v", " "))
    context.say_page(["T01 was fine"])
    wait_ready(context, FIRST)
    assert capsys.readouterr().out.count("T01 was fine") == 2


def test_a_live_screen_ends_when_the_trial_begins(tmp_path, monkeypatch):
    context = make_context(tmp_path, Keys("", " "))
    panels, ends = [], []
    monkeypatch.setattr(context.console, "is_live", True)
    monkeypatch.setattr(context.console, "panel", panels.append)
    monkeypatch.setattr(context.console, "end_panel", lambda: ends.append(len(panels)))
    monkeypatch.setattr(context.console, "say", panels.append)
    wait_ready(context, FIRST)
    assert panels
    assert screen_keys(Prompt.READY) in panels[0]
    assert ends == [0, len(panels)]


def test_without_a_terminal_the_screen_is_printed_line_by_line(tmp_path, capsys):
    context = make_context(tmp_path, Keys(" "))
    wait_ready(context, FIRST)
    out = capsys.readouterr().out
    assert screen_keys(Prompt.READY) in out
    assert f"of {ready_view(context).wanted}" in out


def test_a_note_is_shown_while_it_is_typed(tmp_path, monkeypatch):
    context = make_context(tmp_path, Keys(lines=[None, "wet"]))
    context.operator.draft = "we"
    panels = []
    monkeypatch.setattr(context.console, "is_live", True)
    monkeypatch.setattr(context.console, "panel", panels.append)
    take_note(context, FIRST, is_on_trial=False)
    assert panels[0][0].startswith("Note: we")
    assert NOTE_KEYS in panels[0]
