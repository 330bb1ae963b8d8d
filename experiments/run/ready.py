"""Between two trials: the terrain is reset; notes, pauses, and a look at the last."""

from collections.abc import Callable, Mapping
from dataclasses import replace

from acquisition.control_loop.states import ArmState
from acquisition.errors import SessionError
from experiments.operator.prompts import Prompt
from experiments.operator.screens import NOTE_KEYS, READY_KEYS, ReadyView, ready_lines
from experiments.run.context import Sitting
from experiments.run.foot_keys import FootKeys
from experiments.run.participants import FaultedError
from experiments.session.annotations import LONGEST_TEXT, clean_text
from experiments.session.states import Event
from experiments.session.trial_files import add_remark
from experiments.trial.header import TrialName
from experiments.trial.quality import review_trial


def wait_ready(sitting: Sitting, name: TrialName) -> None:
    """Wait until the trial is to begin, by key or by a double tap of the foot.

    Raises:
        FaultedError, StopAskedError: as `Stage.tick`.
    """
    stage, feet = sitting.stage, FootKeys(sitting.rig)
    while True:
        _show(sitting)
        key = ""
        while key not in _KEYS and key != " ":
            key = stage.tick(Prompt.READY, name) or feet.key(" ")
        stage.look(None)
        if key == " ":
            return
        _KEYS[key](sitting, name)


def ready_view(sitting: Sitting) -> ReadyView:
    """Return what the screen between two trials shows now."""
    state = sitting.book.state
    return ReadyView(
        session=sitting.facts.folder.id,
        terrain=sitting.rig.row.name,
        trial=state.next_trial,
        wanted=state.wanted,
        kept=len(state.kept),
        rejected=state.rejected,
        elapsed=sitting.elapsed,
        left=sitting.time_left,
        reset=sitting.rig.row.reset,
        suggestion=sitting.archive.suggestion(),
    )


def take_note(sitting: Sitting, name: TrialName, *, is_on_trial: bool) -> None:
    """Let a remark be typed and write it into the journal.

    Args:
        sitting: the session.
        name: the trial it is about.
        is_on_trial: it goes into the trial's sidecar too.

    Raises:
        FaultedError: as `Stage.line`.
    """
    stage = sitting.stage
    sitting.say(NOTE_KEYS)
    stage.look(lambda _: [f"Note: {stage.company.keys.draft}▏", NOTE_KEYS])
    try:
        while (text := stage.line(name)) is None:
            pass
    finally:
        stage.look(None)
    try:
        text = clean_text(text[:LONGEST_TEXT])
    except SessionError:  # nothing but spaces
        sitting.say("Nothing noted.")
        return
    _write_note(sitting, name if is_on_trial else None, text)


def _write_note(sitting: Sitting, name: TrialName | None, text: str) -> None:
    book, who = sitting.book, sitting.facts.operator
    if name is None:
        book.note(Event.NOTED, text=text, who=who)
        sitting.say(f"Noted on {sitting.facts.folder.id}: {text}")
        return
    book.note(Event.NOTED, trial=name.number, attempt=name.attempt, text=text, who=who)
    place = add_remark(sitting.facts.folder, name, text, who)
    sitting.say(f"Noted on {place}: {text}")


def _show(sitting: Sitting) -> None:
    """Show the screen: it stays and goes on counting where there is a terminal."""
    view = ready_view(sitting)
    lines = [*ready_lines(view), READY_KEYS]
    if not sitting.stage.company.console.is_live:
        for line in lines:
            sitting.say(line)
        return

    def now(width: int) -> list[str]:
        del width
        newer = replace(view, elapsed=sitting.elapsed, left=sitting.time_left)
        return [*ready_lines(newer), READY_KEYS]

    sitting.stage.look(now)


def _note(sitting: Sitting, name: TrialName) -> None:
    """Take a note on the session, the arm holding meanwhile."""
    sitting.control.request(ArmState.HOLD)
    take_note(sitting, name, is_on_trial=False)
    sitting.control.request(ArmState.FLOAT)


def _pause(sitting: Sitting, name: TrialName) -> None:
    sitting.control.request(ArmState.HOLD)
    sitting.book.note(Event.PAUSED)
    is_over = False
    while not is_over:
        sitting.say("Paused. ARM: holding. [space] to go on.")
        try:
            while sitting.stage.tick(Prompt.PAUSED, name) != " ":
                pass
            is_over = True
        except FaultedError as fault:
            sitting.mend(fault)  # and nobody is there: the pause goes on
    sitting.book.note(Event.CONTINUED)
    sitting.control.request(ArmState.FLOAT)


def _view_last(sitting: Sitting, name: TrialName) -> None:
    """Say the newest review again, or that of the last kept trial on the disk."""
    del name
    if not sitting.page:
        kept = sorted(sitting.facts.folder.trials.glob("T??.mcap"))
        if not kept:
            sitting.say("There is no trial to look at yet.")
            return
        review = sitting.stage.aside(lambda: review_trial(kept[-1]))
        lines = [f" {mark} {text}" for mark, text in review.lines()]
        sitting.page = (f"{kept[-1].stem}, recorded before:", *lines)
    sitting.say_page(sitting.page)


def _quit_after(sitting: Sitting, name: TrialName) -> None:
    """Let the next trial be the last one; the second time, end now.

    Raises:
        StopAskedError: it was asked for twice.
    """
    if sitting.is_last:
        sitting.stage.leave()
    sitting.is_last = True
    sitting.say(f"{name.kept} will be the last one for now. [q] again: quit at once.")


_KEYS: Mapping[str, Callable[[Sitting, TrialName], None]] = {
    "n": _note,
    "p": _pause,
    "v": _view_last,
    "q": _quit_after,
}
