"""What the parts of a session's flow share: rig, operator, journal, progress."""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

from acquisition import TractionError
from acquisition.control_loop import ArmState, GuardVerdict
from acquisition.ipc import LoopClient
from analysis.next_push import Aim
from experiments.messages import FaultContext, fault_text
from experiments.operator import (
    Console,
    FootKeys,
    OperatorFeedback,
    OperatorInput,
    build_feedback,
)
from experiments.rig import Rig
from experiments.run.console_loop import ConsoleLoop
from experiments.run.stop import ArmFaultError, StopFlag
from experiments.session import Event, Journal, StanceTask, TrialName
from experiments.trial import SessionMetadata, TrialArchive


@dataclass(slots=True)
class RunContext:
    """One opening of a session, from activation to the arm at rest.

    Attributes:
        console_loop: lets time pass.
        rig: the rig, its loop running.
        console: where everything is printed.
        operator: answers the prompts.
        stop: requests to stop.
        metadata: of the session.
        journal: events and state.
        archive: the trials' files.
        feedback: bells and speech.
        opened_ns: when it was opened [ns].
        kept_before: how many trials were kept until then.
        fault_context: where in the session a fault would occur now.
        page: the newest review, line by line.
        last_recorded: the newest trial that no tare has followed yet.
        is_last: no trial begins after this one.
        estimate: expected duration, as of the first kept trial [s].
        aim: of the push that was suggested last; None where there was none.
        stance: what the foot is to do by itself; None = it is pushed.
    """

    console_loop: ConsoleLoop
    rig: Rig
    console: Console
    operator: OperatorInput
    stop: StopFlag
    metadata: SessionMetadata
    journal: Journal
    archive: TrialArchive
    feedback: OperatorFeedback
    opened_ns: int
    kept_before: int
    fault_context: FaultContext = field(default_factory=FaultContext)
    page: tuple[str, ...] = ()
    last_recorded: TrialName | None = None
    is_last: bool = False
    estimate: float | None = None
    aim: Aim | None = None
    stance: StanceTask | None = None

    @property
    def loop_client(self) -> LoopClient:
        """The console's side of the loop."""
        return self.console_loop.loop_client

    @property
    def elapsed(self) -> float:
        """How long it has been open [s]."""
        return (self.rig.clock.now_ns() - self.opened_ns) * 1e-9

    @property
    def time_left(self) -> float | None:
        """Expected time for the missing trials [s]; None before the first kept one."""
        kept = len(self.journal.state.kept) - self.kept_before
        missing = self.journal.state.wanted - len(self.journal.state.kept)
        return self.elapsed / kept * missing if kept > 0 else None

    def await_trial(self) -> None:
        """Ask for what the arm does until a trial begins.

        It floats in the hand that puts it down; a foot that will stand is held.
        """
        is_held = self.stance is not None
        self.loop_client.request(ArmState.HOLD if is_held else ArmState.FLOAT)

    def say(self, text: str) -> None:
        """Print one line."""
        self.console.say(text)

    def say_page(self, lines: Iterable[str]) -> None:
        """Print lines that can be viewed again."""
        self.page = tuple(lines)
        for line in self.page:
            self.say(line)

    def report_error(self, error: TractionError) -> None:
        """Print an error, and what is safe."""
        self.console.problem(f"{error} {self.journal.saved()}")

    def report_fault(self, verdict: GuardVerdict) -> None:
        """Print why the guard stopped the arm, and what is safe."""
        self.console.problem(self.fault_text(verdict))

    def watch_foot(self) -> FootKeys:
        """Return the double tap of the foot as a key, if rig.toml wants it."""
        is_wanted = self.rig.settings.rig.operator.double_tap
        return FootKeys(self.loop_client, is_wanted=is_wanted)

    def fault_text(self, verdict: GuardVerdict) -> str:
        """Return why the guard stopped the arm, and what is safe."""
        bus = self.loop_client.loop.bus_condition
        context = replace(self.fault_context, bus=bus)
        return fault_text(verdict, context, self.journal.saved())

    def clear_faults(self, fault: ArmFaultError) -> None:
        """Report a fault after which the arm holds, and go on.

        Raises:
            ArmFaultError: no trial can follow: the arm is not under control.
        """
        verdict = self.console_loop.worst_verdict(fault.verdict)
        if verdict.ends_session:
            raise ArmFaultError(verdict) from fault
        self.report_fault(verdict)
        self.console_loop.clear_faults()

    def update_estimate(self) -> None:
        """Estimate the duration once, when the first trial is kept."""
        left = self.time_left
        if self.estimate is None and left is not None:
            self.estimate = self.elapsed + left

    def append(self, event: Event, **details: object) -> None:
        """Append an event to the journal while the console's heartbeat goes on.

        A slow disk must not keep the console from watching the arm.

        Raises:
            SessionError, TrialFileError: as `Journal.append`.
        """
        self.console_loop.run_aside(lambda: self.journal.append(event, **details))

    def record_verdict(self, event: Event, name: TrialName, reason: str) -> None:
        """Append a verdict to the journal; the files of the trial follow it."""
        self.append(
            event,
            trial=name.number,
            attempt=name.attempt,
            reason=reason,
            who=self.metadata.operator,
        )

    def reject(self, name: TrialName, reason: str) -> None:
        """Reject a trial."""
        self.record_verdict(Event.TRIAL_REJECTED, name, reason)


def open_context(
    console_loop: ConsoleLoop,
    metadata: SessionMetadata,
    journal: Journal,
    stance: StanceTask | None = None,
) -> RunContext:
    """Return the context of a session that is opened now."""
    rig, console = console_loop.rig, console_loop.console
    return RunContext(
        console_loop=console_loop,
        rig=rig,
        console=console,
        operator=console_loop.operator,
        stop=console_loop.stop,
        metadata=metadata,
        journal=journal,
        archive=TrialArchive(rig, metadata),
        feedback=build_feedback(rig.settings.rig.operator, console),
        opened_ns=rig.clock.now_ns(),
        kept_before=len(journal.state.kept),
        stance=stance,
    )
