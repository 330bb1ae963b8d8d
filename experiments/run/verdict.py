"""The verdict on a trial, which is always a person's and always deliberate."""

from experiments.messages import Circumstances
from experiments.operator.prompts import REJECT_REASONS, Prompt
from experiments.operator.screens import review_keys
from experiments.run.context import Sitting
from experiments.run.foot_keys import FootKeys
from experiments.run.participants import FaultedError, StopAskedError
from experiments.run.ready import take_note
from experiments.session.states import Event
from experiments.trial.files import ENOUGH, Outcome
from experiments.trial.header import TrialName

_ENDED = "session ended at the review"


def ask_verdict(sitting: Sitting, name: TrialName, outcome: Outcome) -> None:
    """Ask until a trial is kept or rejected.

    Raises:
        FaultedError: the arm has gone; the trial is rejected.
        StopAskedError: the session is to end; the trial is rejected.
    """
    sitting.say(review_keys())
    sitting.place = Circumstances(name.kept)
    is_whole = outcome.displacement >= ENOUGH * sitting.rig.frame.travel
    feet = FootKeys(sitting.rig)
    while True:
        try:
            key = sitting.stage.tick(Prompt.REVIEW, name, is_complete=is_whole)
            if key == "n":
                take_note(sitting, name, is_on_trial=True)
                sitting.say(review_keys())
        except FaultedError as fault:
            try:
                sitting.mend(fault)
            except FaultedError:
                # The trial is whole: only the end of the session takes it away.
                sitting.reject(name, _ENDED)
                raise
            continue
        if _obey(sitting, name, key or feet.key("k")):
            return


def _obey(sitting: Sitting, name: TrialName, key: str) -> bool:
    """Return whether `key` was a verdict.

    Raises:
        StopAskedError: it, or Ctrl-C, ends the session.
    """
    if key == "k":
        sitting.judge(Event.TRIAL_KEPT, name, "")
        return True
    if key[:1] == "r" and key[1:] in REJECT_REASONS:
        sitting.reject(name, REJECT_REASONS[key[1:]])
        return True
    if key == "q" or sitting.stage.company.stop.count:
        sitting.reject(name, _ENDED)
        raise StopAskedError
    return False
