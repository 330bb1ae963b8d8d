"""One trial on the loop: started, followed, ended, sealed, and what it is worth."""

from acquisition.control_loop.states import ArmState
from acquisition.errors import TractionError, TrialFileError
from acquisition.ipc.child import ProcessLostError
from acquisition.trial_file.writer import TrialHeader
from experiments.fault_injection.plan import Moment
from experiments.messages import CATALOGUE, Circumstances
from experiments.operator.cues import Cue
from experiments.operator.prompts import Prompt
from experiments.operator.screens import live_line
from experiments.run.console_loop import TICK
from experiments.run.context import Sitting
from experiments.run.live import recording_screen
from experiments.run.participants import FaultedError, StopAskedError
from experiments.session.states import Event
from experiments.trial.files import Outcome
from experiments.trial.header import EndWatch, PaceWatch, TrialName, trial_header
from experiments.trial.quality import review_trial

LIVE_SECONDS = 5.0  # between two lines of a running trial


class TrialLostError(TractionError):
    """A running trial that the disk did not take."""

    exit_code = 6


def record_trial(sitting: Sitting, name: TrialName) -> Outcome:
    """Record until the trial is over; return how it ended.

    An interrupted trial is rejected, its files sealed.

    Raises:
        FaultedError, StopAskedError: it was interrupted.
        TrialLostError: the disk is full or gone, or the file is not what was written.
        ProcessLostError: a process has died.
    """
    header = trial_header(sitting.rig, sitting.facts, name)
    outcome = Outcome("bug")
    try:
        _record(sitting, name, header, outcome)
    except FaultedError as fault:
        outcome.reason = fault.verdict.reason
        _end(sitting, name, header, outcome)
        raise
    except StopAskedError:
        outcome.reason = "interrupted"
        sitting.stage.obey_stop()
        _end(sitting, name, header, outcome)
        raise
    except ProcessLostError as lost:
        outcome.reason = f"{lost.name} lost"
        if lost.name != "recorder":
            _end(sitting, name, header, outcome)
        raise
    except TrialFileError as error:
        raise _lost("disk-lost", sitting, name, error) from error
    sitting.control.request(ArmState.HOLD)
    _end(sitting, name, header, outcome)
    return outcome


def _record(
    sitting: Sitting, name: TrialName, header: TrialHeader, outcome: Outcome
) -> None:
    """Record until the trial is over; `outcome` is kept up to date."""
    path = sitting.facts.folder.trials / f"{name.kept}.mcap"
    recorder, stage = sitting.rig.crew.recorder, sitting.stage
    _set_aside(sitting, name.number)
    facts = {"trial": name.number, "attempt": name.attempt}
    sitting.book.note(Event.TRIAL_STARTED, **facts)
    recorder.start(path, header)
    recorder.event(20, "operator", "trial started")
    sitting.control.watch_trial(is_recording=True)
    sitting.cues.give(Cue.START)
    stage.look(recording_screen(sitting.rig, name.kept, outcome))
    try:
        _follow(sitting, name, outcome)
    finally:
        stage.look(None)
        sitting.cues.give(Cue.DONE)


def _set_aside(sitting: Sitting, number: int) -> None:
    """Make room for the repetition of a kept trial."""
    attempt = sitting.book.state.kept_attempt(number)
    if attempt:
        sitting.judge(Event.SET_ASIDE, TrialName(number, attempt), "redone")


def _follow(sitting: Sitting, name: TrialName, outcome: Outcome) -> None:
    """Let the trial run until it is over by itself or by key."""
    rig, stage = sitting.rig, sitting.stage
    start = rig.clock.now_ns()
    watch, pace = EndWatch(rig.frame.travel), PaceWatch()
    said = 0.0
    while True:
        outcome.seconds = (rig.clock.now_ns() - start) * 1e-9
        sitting.place = Circumstances(name.kept, outcome.seconds)
        key = stage.tick(Prompt.RECORDING, name)
        record = sitting.control.latest()[0]
        outcome.displacement = float(rig.frame.displacement(record["foot_position"]))
        stage.raise_faults(Moment.RECORDING, name.number, outcome.seconds)
        over = watch.reason(outcome.seconds, outcome.displacement)
        if key == " " or over:
            outcome.reason = over or "key"
            return
        if pace.is_too_fast(outcome.seconds, outcome.displacement):
            sitting.cues.give(Cue.TOO_FAST)
        if not stage.company.console.is_live and outcome.seconds >= said + LIVE_SECONDS:
            said = outcome.seconds
            v_t, F_t, F_n = record["traction"].tolist()
            where = (outcome.seconds, outcome.displacement, rig.frame.travel)
            late = sitting.control.late_cycles
            sitting.say(live_line(name.kept, where, (v_t, F_t, F_n), late))


def _end(
    sitting: Sitting, name: TrialName, header: TrialHeader, outcome: Outcome
) -> None:
    """Seal the files, say what they are worth; an interrupted one is rejected."""
    archive, recorder = sitting.archive, sitting.rig.crew.recorder
    sitting.control.watch_trial(is_recording=False)
    sitting.control.advance(TICK)  # what the devices said until now is written down
    recorder.event(20, "link", sitting.control.device_facts().get("link", ""))
    recorder.event(20, "stop", outcome.reason)
    try:
        verified = sitting.stage.aside(
            lambda: archive.seal(header, name, outcome.reason)
        )
    except TrialFileError as error:
        raise _lost("write-failed", sitting, name, error) from error
    archive.write_sidecar(name, verified, outcome)
    facts = {"trial": name.number, "attempt": name.attempt}
    sitting.book.note(Event.TRIAL_RECORDED, **facts)
    written = (
        f"{name.kept} {outcome.status} {outcome.seconds:.2f} s · {verified.cycles} "
        "samples · written and verified"
    )
    if outcome.status == "complete":
        path = sitting.facts.folder.trials / f"{name.kept}.mcap"
        review = sitting.stage.aside(lambda: review_trial(path))
        lines = [f" {m} {text}" for m, text in review.lines(archive.kept_ratios())]
        sitting.say_page([written, *lines])
        archive.write_sidecar(name, verified, outcome, review)
        return
    sitting.say(written)
    sitting.reject(name, f"interrupted: {outcome.reason}")
    sitting.say(f"{name.kept} kept as interrupted: rejected/{name.rejected}.mcap.")
    if outcome.reason != "interrupted":
        sitting.say(archive.flight(header, name, outcome.reason))


def _lost(
    message: str, sitting: Sitting, name: TrialName, error: TrialFileError
) -> TrialLostError:
    """Let the arm hold and return what is said of a trial the disk did not take."""
    sitting.control.request(ArmState.HOLD)
    seconds = sitting.place.seconds
    facts = {
        "trial": name.kept,
        "when": "" if seconds is None else f" at {seconds:.2f} s",
        "detail": error.reason,
        "path": sitting.facts.folder.trials / f"{name.kept}.mcap.partial",
    }
    found = CATALOGUE[message]
    return TrialLostError(
        found.what.format_map(facts),
        hint=found.do.format_map(facts),
        arm_state=found.arm,
    )
