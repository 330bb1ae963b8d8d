"""Verdicts and notes of the operator: at the review, and on undo."""

from acquisition.control_loop.states import ArmState
from acquisition.errors import SessionError, TractionError
from analysis.data.prepare import MINIMUM_TRAVEL_SHARE
from experiments.arguments import data_option
from experiments.messages import FaultContext
from experiments.operator.console import WARNING
from experiments.operator.keys import NOTE_KEYS, REJECT_REASONS, KeyAction, key_action
from experiments.operator.prompts import Prompt
from experiments.operator.scripted import NO_PERSONS
from experiments.run.context import RunContext, RunServices
from experiments.run.stop import ArmFaultError, StopRequestedError
from experiments.session.annotations import MAX_TEXT, clean_text
from experiments.session.sidecar import TrialName, TrialOutcome
from experiments.session.states import Event

_ENDED = "session ended at the review"
_NO_VERDICT = (
    "{trial} has no verdict yet: [k] keeps it, [r1]..[r5] rejects it; the session ends "
    "then. [q] again ends it now: {trial} goes to rejected/, nothing is lost."
)


def ask_verdict(context: RunContext, name: TrialName, outcome: TrialOutcome) -> None:
    """Ask until the operator keeps or rejects the trial.

    Raises:
        ArmFaultError: the arm is not under control; the trial is rejected.
        StopRequestedError: the session is to end; the trial is rejected.
    """
    context.say_keys(Prompt.REVIEW)
    context.state.fault_context = FaultContext(name.kept, prompt=Prompt.REVIEW)
    least = MINIMUM_TRAVEL_SHARE * context.rig.frame.travel
    is_whole = outcome.displacement >= least
    is_asked = not is_whole  # [q] rejects an incomplete trial at once
    feet = context.watch_foot()
    while True:
        try:
            key = context.console_loop.tick(Prompt.REVIEW, name, is_complete=is_whole)
            if key_action(Prompt.REVIEW, key) is KeyAction.NOTE:
                take_note(context, name, is_on_trial=True)
                context.say_keys(Prompt.REVIEW)
        except ArmFaultError as fault:
            try:
                context.clear_faults(fault)
            except ArmFaultError:
                # The trial is complete, but no verdict can be given any more.
                context.reject(name, _ENDED)
                raise
            continue
        if key_action(Prompt.REVIEW, key) is KeyAction.QUIT and not is_asked:
            is_asked = context.state.is_last = True
            context.say(_NO_VERDICT.format(trial=name.kept))
        elif _apply_key(context, name, key or feet.key("k")):
            return


def _apply_key(context: RunContext, name: TrialName, key: str) -> bool:
    """Return whether `key` was a verdict.

    Raises:
        StopRequestedError: `key` or Ctrl-C ends the session.
    """
    action = key_action(Prompt.REVIEW, key)
    if action is KeyAction.KEEP:
        context.record_verdict(Event.TRIAL_KEPT, name, "")
        context.open_undo(name, "", is_kept=True)
        return True
    if action is KeyAction.REDO:
        reason = REJECT_REASONS[key[1:]]
        context.reject(name, reason)
        context.open_undo(name, reason, is_kept=False)
        return True
    if action is KeyAction.QUIT or context.stop.count:
        context.reject(name, _ENDED)
        context.say(_unjudged_text(context, name))
        raise StopRequestedError
    return False


def await_undo(context: RunContext) -> None:
    """Let a person undo the last verdict before the session ends.

    All trials are kept already: a fault is printed, and the session ends as usual.

    Raises:
        UndoRequestedError: the verdict is undone.
    """
    if context.state.given is None or context.operator.who in NO_PERSONS:
        return
    context.say("[space] to end the session  [u]ndo the verdict")
    while context.console_loop.undo_left:
        try:
            if context.console_loop.tick(Prompt.UNDO) == " ":
                return
        except StopRequestedError:  # [q] ends it too
            return
        except ArmFaultError as fault:
            context.say(f"{WARNING} {context.fault_text(fault.verdict)}")
        except TractionError as error:
            context.say(f"{WARNING} {error.message}")
            return


def judge_again(context: RunContext) -> None:
    """Ask again for the newest verdict, which stands until another is given.

    Raises:
        ArmFaultError: the arm is not under control.
        StopRequestedError: the session is to end.
    """
    given = context.close_undo()
    if given is None:
        return
    context.console_loop.show(None)
    context.loop_client.request(ArmState.HOLD)
    context.state.fault_context = FaultContext(given.name.kept, prompt=Prompt.REVIEW)
    context.say_page(context.state.page)
    context.say(f"{given.text}: this stands until you give another verdict.")
    context.say_keys(Prompt.REVIEW)
    action, key = None, ""
    while action not in (KeyAction.KEEP, KeyAction.REDO):
        try:
            key = context.console_loop.tick(Prompt.REVIEW, given.name, is_complete=True)
            action = key_action(Prompt.REVIEW, key)
            if action is KeyAction.NOTE:
                take_note(context, given.name, is_on_trial=True)
                context.say_keys(Prompt.REVIEW)
        except ArmFaultError as fault:
            context.clear_faults(fault)
        if action is KeyAction.QUIT or context.stop.count:
            raise StopRequestedError
    context.change_verdict(
        given, is_kept=action is KeyAction.KEEP, reason=REJECT_REASONS.get(key[1:], "")
    )


def take_note(services: RunServices, name: TrialName, *, is_on_trial: bool) -> None:
    """Read a typed note and write it into the journal.

    Args:
        services: services of the session.
        name: the current trial.
        is_on_trial: whether the note also goes into the trial's sidecar.

    Raises:
        ArmFaultError: as `ConsoleLoop.line`.
    """
    console_loop = services.console_loop
    services.say(NOTE_KEYS)
    console_loop.show(lambda _: [f"Note: {services.operator.draft}▏", NOTE_KEYS])
    try:
        while (text := console_loop.poll_note(name)) is None:
            pass
    finally:
        console_loop.show(None)
    try:
        text = clean_text(text[:MAX_TEXT])
    except SessionError:  # nothing but spaces
        services.say("Nothing noted.")
        return
    _write_note(services, name if is_on_trial else None, text)


def _write_note(services: RunServices, name: TrialName | None, text: str) -> None:
    who = services.metadata.operator
    if name is None:
        services.append(Event.NOTED, text=text, who=who)
        services.say(f"Noted on {services.metadata.folder.id}: {text}")
        return
    services.append(
        Event.NOTED, trial=name.number, attempt=name.attempt, text=text, who=who
    )
    stem = services.journal.state.attempt_at(name).stem
    services.say(f"Noted on {stem}: {text}")


def _unjudged_text(services: RunServices, name: TrialName) -> str:
    """Message on a trial without a verdict: its location and how to keep it."""
    session = services.metadata.folder
    command = f"traction verdict {session.id} {name.rejected} keep REASON"
    command += data_option(session.path.parent.parent)
    what = f"{name.kept} was not judged: rejected/{name.rejected}.mcap."
    return f"{what} To keep it: {command}"
