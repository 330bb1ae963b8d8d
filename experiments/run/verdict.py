"""The verdict on a trial, which is always a person's and always deliberate."""

from analysis.data.prepare import MINIMUM_TRAVEL_SHARE
from experiments.messages import FaultContext
from experiments.operator.double_tap import FootKeys
from experiments.operator.prompts import REJECT_REASONS, Prompt
from experiments.operator.screens import review_keys
from experiments.run.context import RunContext
from experiments.run.participants import ArmFaultError, StopRequestedError
from experiments.run.ready import take_note
from experiments.session.states import Event
from experiments.trial.files import TrialOutcome
from experiments.trial.header import TrialName

_ENDED = "session ended at the review"


def ask_verdict(context: RunContext, name: TrialName, outcome: TrialOutcome) -> None:
    """Ask until a trial is kept or rejected.

    Raises:
        FaultedError: the arm has gone; the trial is rejected.
        StopAskedError: the session is to end; the trial is rejected.
    """
    context.say(review_keys())
    context.place = FaultContext(name.kept)
    is_whole = outcome.displacement >= MINIMUM_TRAVEL_SHARE * context.rig.frame.travel
    feet = FootKeys(context.rig)
    while True:
        try:
            key = context.console_loop.tick(Prompt.REVIEW, name, is_complete=is_whole)
            if key == "n":
                take_note(context, name, is_on_trial=True)
                context.say(review_keys())
        except ArmFaultError as fault:
            try:
                context.clear_faults(fault)
            except ArmFaultError:
                # The trial is whole: only the end of the session takes it away.
                context.reject(name, _ENDED)
                raise
            continue
        if _obey(context, name, key or feet.key("k")):
            return


def _obey(context: RunContext, name: TrialName, key: str) -> bool:
    """Return whether `key` was a verdict.

    Raises:
        StopAskedError: it, or Ctrl-C, ends the session.
    """
    if key == "k":
        context.judge(Event.TRIAL_KEPT, name, "")
        return True
    if key[:1] == "r" and key[1:] in REJECT_REASONS:
        context.reject(name, REJECT_REASONS[key[1:]])
        return True
    if key == "q" or context.console_loop.company.stop.count:
        context.reject(name, _ENDED)
        raise StopRequestedError
    return False
