"""The runner: lift, tare, put down, record, review, until the session is complete."""

import traceback

from acquisition.control_loop.states import ArmState
from acquisition.errors import TractionError
from experiments.messages import CATALOGUE, FaultContext, rest_text
from experiments.operator.feedback import build_cues
from experiments.operator.screens import EndView, end_lines
from experiments.run.activation import activate
from experiments.run.console_loop import ConsoleLoop
from experiments.run.context import RunContext
from experiments.run.participants import ArmFaultError, StopRequestedError
from experiments.run.ready import wait_ready
from experiments.run.record import record_trial
from experiments.run.tare import take_end_tare, take_tare
from experiments.run.verdict import ask_verdict
from experiments.session.journal import Journal, at_once
from experiments.session.states import Event
from experiments.session.store import write_text
from experiments.trial.files import TrialArchive
from experiments.trial.header import SessionFacts, TrialName

FAULTS_IN_A_ROW = 5  # end the session: something is wrong that redoing cannot mend


class SessionRunner:
    """Runs one session on a rig that passed its preflight."""

    def __init__(
        self, console_loop: ConsoleLoop, facts: SessionFacts, journal: Journal
    ) -> None:
        self._sitting = RunContext(
            console_loop=console_loop,
            facts=facts,
            journal=journal,
            archive=TrialArchive(console_loop.rig, facts),
            feedback=build_cues(
                console_loop.rig.settings.rig.operator, console_loop.company.console
            ),
            begun_ns=console_loop.rig.clock.now_ns(),
            kept_before=len(journal.state.kept),
            place=FaultContext(),
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
        context = self._sitting
        context.journal.note(opening, **asked)
        context.journal.aside = context.console_loop.aside
        code, reason = 1, "bug"
        try:
            self._record_all()
            code = 0
            reason = "complete" if context.journal.state.is_complete else "unfinished"
        except StopRequestedError:
            code, reason = CATALOGUE["interrupted"].exit_code, "unfinished"
            self._tell_stop()
        except ArmFaultError as fault:
            code, reason = 4, fault.verdict.reason
            context.tell_fault(fault.verdict)
        except TractionError as error:
            code, reason = error.exit_code, "error"
            context.tell(error)
        except Exception:  # the arm first, then the person, the traceback to the log
            self._tell_bug(self._make_safe(), traceback.format_exc())
        finally:
            context.feedback.close()
            context.say(self._make_safe())
            context.journal.aside = at_once  # the arm is idle: nobody has to look
            context.journal.note(Event.ENDED, reason=reason)
            if not code:
                self._say_end()
        return code

    def _record_all(self) -> None:
        context, state = self._sitting, self._sitting.journal
        activate(context.console_loop)
        state.note(Event.ACTIVATED)
        while not state.state.is_over:
            self._try_trial()
            if context.estimate is None and (left := context.time_left) is not None:
                context.estimate = context.elapsed + left
            if context.is_last and not state.state.is_over:
                context.console_loop.leave()
        take_end_tare(context)

    def _try_trial(self) -> None:
        """One trial; a fault that leaves the arm holding does not end the session."""
        context = self._sitting
        context.place = FaultContext()
        try:
            self._one_trial()
        except ArmFaultError as fault:
            self._faults += 1
            if self._faults >= FAULTS_IN_A_ROW:
                raise ArmFaultError(
                    context.console_loop.worst(fault.verdict)
                ) from fault
            context.clear_faults(fault)
        else:
            self._faults = 0

    def _one_trial(self) -> None:
        context = self._sitting
        number = context.journal.state.next_trial
        name = TrialName(number, context.journal.state.attempt(number) + 1)
        take_tare(context, name)
        context.control.request(ArmState.FLOAT)
        wait_ready(context, name)
        outcome = record_trial(context, name)
        ask_verdict(context, name, outcome)

    # --- words --------------------------------------------------------------------

    def _make_safe(self) -> str:
        """Idle the arm and return where it is; the second call does nothing more."""
        console_loop = self._sitting.console_loop
        confirmed = console_loop.make_safe()
        return rest_text(console_loop.rig.backend.safety_mode(), is_confirmed=confirmed)

    def _tell_stop(self) -> None:
        context = self._sitting
        context.say(CATALOGUE["interrupted"].text({}, context.journal.saved()))

    def _tell_bug(self, rest: str, text: str) -> None:
        """Say where the arm is and what is safe; the traceback goes to the log."""
        context = self._sitting
        log = context.facts.folder.path / "log.txt"
        facts = {"error": text.splitlines()[-1], "rest": rest, "log": log}
        message = CATALOGUE["bug"].text(facts, context.journal.saved())
        context.console_loop.company.console.problem(message)
        write_text(log, text)

    def _say_end(self) -> None:
        context = self._sitting
        state, folder = context.journal.state, context.facts.folder
        view = EndView(
            session=folder.id,
            terrain=state.terrain,
            kept=len(state.kept),
            wanted=state.wanted,
            rejected=state.rejected,
            elapsed=context.elapsed,
            estimate=context.estimate,
            drift=state.drift,
        )
        for line in end_lines(view):
            context.say(line)
