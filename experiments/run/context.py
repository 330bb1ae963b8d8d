"""One opening of a session as far as it has come: who takes part, what was said."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

from acquisition.control_loop.faults import GuardVerdict
from acquisition.errors import TractionError
from acquisition.ipc.loop_client import LoopClient
from experiments.messages import FaultContext, fault_text
from experiments.operator.feedback import OperatorFeedback
from experiments.rig.rig import Rig
from experiments.run.console_loop import ConsoleLoop
from experiments.run.participants import ArmFaultError
from experiments.session.journal import Journal
from experiments.session.states import Event
from experiments.trial.files import TrialArchive
from experiments.trial.header import SessionFacts, TrialName


@dataclass(slots=True)
class RunContext:
    """What the parts of the flow share.

    Attributes:
        stage: where time passes.
        facts: of the session.
        book: journal and state.
        archive: the trials' files.
        cues: what is rung and spoken.
        begun_ns: when it was opened [ns].
        kept_before: how many trials were kept until then.
        place: where a fault would come now.
        page: the newest review, line by line.
        is_last: no trial is begun after this one.
        estimate: how long it looked like taking after the first kept trial [s].
    """

    console_loop: ConsoleLoop
    facts: SessionFacts
    journal: Journal
    archive: TrialArchive
    feedback: OperatorFeedback
    begun_ns: int
    kept_before: int
    place: FaultContext
    page: tuple[str, ...] = ()
    is_last: bool = False
    estimate: float | None = None

    @property
    def rig(self) -> Rig:
        """The rig it runs on."""
        return self.console_loop.rig

    @property
    def control(self) -> LoopClient:
        """The console's side of the loop."""
        return self.console_loop.control

    @property
    def elapsed(self) -> float:
        """How long it has been open [s]."""
        return (self.rig.clock.now_ns() - self.begun_ns) * 1e-9

    @property
    def time_left(self) -> float | None:
        """How long the missing trials will take at this pace [s]; None = who knows."""
        kept = len(self.journal.state.kept) - self.kept_before
        missing = self.journal.state.wanted - len(self.journal.state.kept)
        return self.elapsed / kept * missing if kept > 0 else None

    def say(self, text: str) -> None:
        """Say one line."""
        self.console_loop.company.console.say(text)

    def say_page(self, lines: Iterable[str]) -> None:
        """Say lines that can be looked at again."""
        self.page = tuple(lines)
        for line in self.page:
            self.say(line)

    def tell(self, error: TractionError) -> None:
        """Say what went wrong, and what is safe."""
        self.console_loop.company.console.problem(f"{error} {self.journal.saved()}")

    def tell_fault(self, verdict: GuardVerdict) -> None:
        """Say why the guard stopped the arm, and what is safe."""
        self.console_loop.company.console.problem(self.fault_text(verdict))

    def fault_text(self, verdict: GuardVerdict) -> str:
        """Return why the guard stopped the arm, and what is safe."""
        found = replace(self.place, is_bus_down=self.control.loop.is_bus_down)
        return fault_text(verdict, found, self.journal.saved())

    def clear_faults(self, fault: ArmFaultError) -> None:
        """Say why the guard stopped the arm, which holds, and go on.

        Raises:
            FaultedError: no trial can follow: the arm has gone.
        """
        verdict = self.console_loop.worst(fault.verdict)
        if verdict.ends_session:
            raise ArmFaultError(verdict) from fault
        self.tell_fault(verdict)
        self.console_loop.clear_faults()

    def judge(self, event: Event, name: TrialName, why: str) -> None:
        """Write a verdict into the journal; the files of the trial follow it."""
        self.journal.note(
            event,
            trial=name.number,
            attempt=name.attempt,
            reason=why,
            who=self.facts.operator,
        )

    def reject(self, name: TrialName, why: str) -> None:
        """Put a trial among the rejected ones."""
        self.judge(Event.TRIAL_REJECTED, name, why)
