"""The runner: lift, tare, put down, record, review, until the session is complete."""

import traceback

from acquisition.control_loop.states import ArmState
from acquisition.errors import TractionError
from experiments.messages import CATALOGUE, Circumstances, rest_text
from experiments.operator.cues import build_cues
from experiments.operator.screens import EndView, end_lines
from experiments.run.activation import activate
from experiments.run.console_loop import Stage
from experiments.run.context import Sitting
from experiments.run.participants import FaultedError, StopAskedError
from experiments.run.ready import wait_ready
from experiments.run.record import record_trial
from experiments.run.tare import take_end_tare, take_tare
from experiments.run.verdict import ask_verdict
from experiments.session.journal import Book, at_once
from experiments.session.states import Event
from experiments.session.store import write_text
from experiments.trial.files import Archive
from experiments.trial.header import SessionFacts, TrialName

FAULTS_IN_A_ROW = 5  # end the session: something is wrong that redoing cannot mend


class SessionRunner:
    """Runs one session on a rig that passed its preflight."""

    def __init__(self, stage: Stage, facts: SessionFacts, book: Book) -> None:
        self._sitting = Sitting(
            stage=stage,
            facts=facts,
            book=book,
            archive=Archive(stage.rig, facts),
            cues=build_cues(stage.rig.settings.rig.operator, stage.company.console),
            begun_ns=stage.rig.clock.now_ns(),
            kept_before=len(book.state.kept),
            place=Circumstances(),
        )
        self._faults = 0

    def run(self, opening: Event, **asked: object) -> int:
        """Record until nothing is left to record; return the exit code.

        Every way out - complete, stop, fault, bug - leaves the arm idle and what was
        recorded on the disk.

        Args:
            opening: how the session is opened: started, resumed, or for a redo.
            asked: what the journal keeps of it.
        """
        sitting = self._sitting
        sitting.book.note(opening, **asked)
        sitting.book.aside = sitting.stage.aside
        code, reason = 1, "bug"
        try:
            self._record_all()
            code = 0
            reason = "complete" if sitting.book.state.is_complete else "unfinished"
        except StopAskedError:
            code, reason = CATALOGUE["interrupted"].exit_code, "unfinished"
            self._tell_stop()
        except FaultedError as fault:
            code, reason = 4, fault.verdict.reason
            sitting.tell_fault(fault.verdict)
        except TractionError as error:
            code, reason = error.exit_code, "error"
            sitting.tell(error)
        except Exception:  # the arm first, then the person, the traceback to the log
            self._tell_bug(self._make_safe(), traceback.format_exc())
        finally:
            sitting.cues.close()
            sitting.say(self._make_safe())
            sitting.book.aside = at_once  # the arm is idle: nobody has to look
            sitting.book.note(Event.ENDED, reason=reason)
            if not code:
                self._say_end()
        return code

    def _record_all(self) -> None:
        sitting, state = self._sitting, self._sitting.book
        activate(sitting.stage)
        state.note(Event.ACTIVATED)
        while not state.state.is_over:
            self._try_trial()
            if sitting.estimate is None and (left := sitting.time_left) is not None:
                sitting.estimate = sitting.elapsed + left
            if sitting.is_last and not state.state.is_over:
                sitting.stage.leave()
        take_end_tare(sitting)

    def _try_trial(self) -> None:
        """One trial; a fault that leaves the arm holding does not end the session."""
        sitting = self._sitting
        sitting.place = Circumstances()
        try:
            self._one_trial()
        except FaultedError as fault:
            self._faults += 1
            if self._faults >= FAULTS_IN_A_ROW:
                raise FaultedError(sitting.stage.worst(fault.verdict)) from fault
            sitting.mend(fault)
        else:
            self._faults = 0

    def _one_trial(self) -> None:
        sitting = self._sitting
        number = sitting.book.state.next_trial
        name = TrialName(number, sitting.book.state.attempt(number) + 1)
        take_tare(sitting, name)
        sitting.control.request(ArmState.FLOAT)
        wait_ready(sitting, name)
        outcome = record_trial(sitting, name)
        ask_verdict(sitting, name, outcome)

    # --- words --------------------------------------------------------------------

    def _make_safe(self) -> str:
        """Idle the arm and return where it is; the second call does nothing more."""
        stage = self._sitting.stage
        confirmed = stage.make_safe()
        return rest_text(stage.rig.crew.safety_mode(), is_confirmed=confirmed)

    def _tell_stop(self) -> None:
        sitting = self._sitting
        sitting.say(CATALOGUE["interrupted"].text({}, sitting.book.saved()))

    def _tell_bug(self, rest: str, text: str) -> None:
        """Say where the arm is and what is safe; the traceback goes to the log."""
        sitting = self._sitting
        log = sitting.facts.folder.path / "log.txt"
        facts = {"error": text.splitlines()[-1], "rest": rest, "log": log}
        message = CATALOGUE["bug"].text(facts, sitting.book.saved())
        sitting.stage.company.console.problem(message)
        write_text(log, text)

    def _say_end(self) -> None:
        sitting = self._sitting
        state, folder = sitting.book.state, sitting.facts.folder
        view = EndView(
            session=folder.id,
            terrain=state.terrain,
            kept=len(state.kept),
            wanted=state.wanted,
            rejected=state.rejected,
            elapsed=sitting.elapsed,
            estimate=sitting.estimate,
            drift=state.drift,
        )
        for line in end_lines(view):
            sitting.say(line)
