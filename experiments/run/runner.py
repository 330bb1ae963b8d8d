"""The runner: lift, tare, put down, record, review, until the session is complete."""

import traceback
from collections.abc import Callable
from dataclasses import replace

from acquisition.errors import TractionError
from experiments.messages import CATALOGUE, FaultContext, rest_text
from experiments.operator.screens import EndView, end_lines
from experiments.run.console_loop import ConsoleLoop
from experiments.run.context import open_context
from experiments.run.ready import activate, wait_ready
from experiments.run.record import record_trial
from experiments.run.stop import ArmFaultError, StopRequestedError, UndoRequestedError
from experiments.run.tare import take_end_tare, take_tare, verify_mounting
from experiments.run.trial import SessionMetadata
from experiments.run.verdicts import ask_verdict, await_undo, judge_again
from experiments.session.data_files import write_text
from experiments.session.journal import Journal
from experiments.session.sidecar import TrialName
from experiments.session.states import Event

FAULTS_IN_A_ROW = 5  # end the session
_FAULT_CODE = 4  # exit code of a fault of the arm
# the arm at an error that is not of the arm
_HOLDING = "holding; support it before it goes idle"
_UNCONTROLLED = "not under control; support it now"


class SessionRunner:
    """Runs one session on a rig that passed its preflight."""

    def __init__(
        self,
        console_loop: ConsoleLoop,
        metadata: SessionMetadata,
        journal: Journal,
    ) -> None:
        self._context = open_context(console_loop, metadata, journal)
        self._faults = 0

    def run(self, opening: Event, **details: object) -> int:
        """Record all outstanding trials; returns the exit code.

        Every exit - complete, stop, fault, bug - leaves the arm idle and the recordings
        on the disk.

        Args:
            opening: kind of opening: started, resumed, or for a redo.
            details: fields of its event in the journal.
        """
        context = self._context
        context.append(opening, **details)
        code, reason = 1, "bug"
        try:
            self._record_all()
            code = 0
            reason = "complete" if context.journal.state.is_complete else "unfinished"
        except StopRequestedError:
            code, reason = CATALOGUE["interrupted"].exit_code, "unfinished"
            message = CATALOGUE["interrupted"]
            if not context.console_loop.is_carrying:  # not yet, or not any more
                message = replace(message, arm="")
            context.say(message.text({}, context.journal.saved_message()))
        except ArmFaultError as fault:
            code, reason = _FAULT_CODE, fault.verdict.reason
            context.state.fault_context = replace(
                context.state.fault_context, prompt=None
            )
            context.report_fault(fault.verdict)
        except TractionError as error:
            code, reason = self._report_failure(error), "error"
        except Exception:  # the arm first, then the message, the traceback to the log
            self._report_bug(self._make_safe(), traceback.format_exc())
        finally:
            context.feedback.close()
            context.console_loop.lay_down()
            context.say(self._make_safe())
            # The arm is idle: the disk may take its time.
            context.journal.append(Event.ENDED, reason=reason)
            if not code:
                self._print_end()
        return code

    def _record_all(self) -> None:
        context = self._context
        activate(context.console_loop)
        context.append(Event.ACTIVATED)
        verify_mounting(context)
        is_over = False
        while not is_over:
            while not context.journal.state.is_over:
                self._try(self._run_trial)
                context.update_estimate()
                if context.state.is_last and not context.journal.state.is_over:
                    raise StopRequestedError
            self._try(self._close_session)
            is_over = context.journal.state.is_over

    def _close_session(self) -> None:
        """Take the final tare, and allow an undo of the last verdict."""
        take_end_tare(self._context)
        await_undo(self._context)

    def _try(self, step: Callable[[], None]) -> None:
        """Run one step; a fault that leaves the arm holding does not end the session.

        Neither does an undo of the verdict: the trial is judged again.
        """
        context = self._context
        context.state.fault_context = FaultContext()
        try:
            try:
                step()
            except UndoRequestedError:
                judge_again(context)
        except ArmFaultError as fault:
            self._faults += 1
            if self._faults >= FAULTS_IN_A_ROW:
                verdict = context.console_loop.worst_verdict(fault.verdict)
                raise ArmFaultError(verdict) from fault
            context.clear_faults(fault)
        else:
            self._faults = 0

    def _run_trial(self) -> None:
        context = self._context
        number = context.journal.state.next_trial
        name = TrialName(number, context.journal.state.attempt(number) + 1)
        take_tare(context, name)
        context.await_trial()
        wait_ready(context, name)
        context.close_undo()
        outcome = record_trial(context, name)
        ask_verdict(context, name, outcome)

    def _report_failure(self, error: TractionError) -> int:
        """Report an error that ends the session, and a fault that stands besides.

        What the fault does to the arm stands, not what the error alone would do.
        Returns the exit code.
        """
        context = self._context
        verdict = context.console_loop.standing_verdict()
        if verdict is None:
            error.arm_state = self._arm_state(error.arm_state)
            context.report_error(error)
            return error.exit_code
        error.arm_state = ""
        context.console.problem(str(error))
        context.state.fault_context = replace(context.state.fault_context, prompt=None)
        context.report_fault(verdict)
        return _FAULT_CODE if verdict.ends_session else error.exit_code

    def _arm_state(self, stated: str) -> str:
        """Return what the arm does at an error that is not of the arm.

        Args:
            stated: what the error says; it does not know whether the loop still runs.
        """
        context = self._context
        if not context.rig.backend.is_controlled:
            return _UNCONTROLLED
        return stated or (_HOLDING if context.console_loop.is_carrying else "")

    def _make_safe(self) -> str:
        """Idle the arm; returns its state as text; safe to repeat."""
        context = self._context
        is_confirmed = context.console_loop.make_safe()
        return rest_text(context.rig.backend.safety_mode(), is_confirmed=is_confirmed)

    def _report_bug(self, arm_text: str, trace: str) -> None:
        """Print the state of the arm and what is safe; logs the traceback."""
        context = self._context
        log = context.metadata.folder.path / "log.txt"
        details = {"error": trace.splitlines()[-1], "rest": arm_text, "log": log}
        message = CATALOGUE["bug"].text(details, context.journal.saved_message())
        context.console.problem(message)
        write_text(log, trace)

    def _print_end(self) -> None:
        context = self._context
        state, folder = context.journal.state, context.metadata.folder
        view = EndView(
            session=folder.id,
            terrain=state.terrain,
            kept=len(state.kept),
            wanted=state.wanted,
            rejected=state.rejected,
            elapsed=context.elapsed,
            estimate=context.state.estimate,
            drift=state.drift,
        )
        for line in end_lines(view):
            context.say(line)
