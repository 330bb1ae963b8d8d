"""Context shared by the steps of a session: rig, operator, journal, progress."""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

from acquisition.control_loop.faults import GuardVerdict
from acquisition.control_loop.states import ArmState
from acquisition.errors import TractionError
from acquisition.ipc.loop_client import LoopClient
from experiments.messages import REPORT, ComputerLoad, FaultContext, fault_text
from experiments.operator.console import Console
from experiments.operator.feedback import OperatorFeedback, build_feedback
from experiments.operator.foot_gesture import FootKeys
from experiments.operator.graphs import packed
from experiments.operator.keys import screen_keys
from experiments.operator.prompts import OperatorInput, Prompt
from experiments.rig.rig import Rig
from experiments.run.console_loop import ConsoleLoop
from experiments.run.stop import ArmFaultError, StopFlag
from experiments.run.trial import SessionMetadata, TrialArchive
from experiments.session.journal import Journal
from experiments.session.sidecar import KEEP, REJECT, TrialName
from experiments.session.states import Event

UNDO_NS = 10_000_000_000  # time to undo a verdict [ns]


@dataclass(frozen=True, slots=True)
class GivenVerdict:
    """The newest verdict.

    Attributes:
        name: name of the attempt.
        is_kept: kept, not rejected.
        text: the verdict as text.
    """

    name: TrialName
    is_kept: bool
    text: str


@dataclass(slots=True)
class FlowState:
    """State of an open session; each attribute names the step that sets it.

    Attributes:
        fault_context: current step, for the message of a fault; set by every step that
            waits for a person.
        page: lines of the newest review; set by `say_page`.
        is_last: no further trial after this one; set by `ready` and `verdicts`.
        estimate: expected duration, as of the first kept trial [s]; set by
            `update_estimate`.
        ticked: numbers of the ticked reset steps; set by `ready`, cleared by `record`.
        given: newest verdict, None before the first or after an undo; set by
            `open_undo` and `close_undo`.
    """

    fault_context: FaultContext = field(default_factory=FaultContext)
    page: tuple[str, ...] = ()
    is_last: bool = False
    estimate: float | None = None
    ticked: set[int] = field(default_factory=set[int])
    given: GivenVerdict | None = None


@dataclass(frozen=True, slots=True)
class RunServices:
    """Fixed services for the steps of one opening of a session.

    Attributes:
        console_loop: the console's cycle.
        rig: the rig, its loop running.
        console: output.
        operator: answers the prompts.
        stop: requests to stop.
        metadata: metadata of the session.
        journal: events and state.
        archive: the trials' files.
        feedback: sounds and speech.
        opened_ns: time of the opening [ns].
        kept_before: number of trials kept until then.
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

    @property
    def loop_client(self) -> LoopClient:
        """The console's side of the loop."""
        return self.console_loop.loop_client

    @property
    def elapsed(self) -> float:
        """Time since the opening [s]."""
        return (self.rig.clock.now_ns() - self.opened_ns) * 1e-9

    @property
    def time_left(self) -> float | None:
        """Expected time for the missing trials [s]; None before the first is kept."""
        kept = len(self.journal.state.kept) - self.kept_before
        missing = self.journal.state.wanted - len(self.journal.state.kept)
        return self.elapsed / kept * missing if kept > 0 else None

    def await_trial(self) -> None:
        """Let the arm float, so that the operator can put the foot down."""
        self.loop_client.request(ArmState.FLOAT)

    def say(self, text: str) -> None:
        """Print one line."""
        self.console.say(text)

    def say_keys(self, prompt: Prompt) -> None:
        """Print the keys of `prompt`, wrapped between keys."""
        self.say(packed(screen_keys(prompt), self.console.width))

    def report_error(self, error: TractionError) -> None:
        """Print an error, and how many trials are safe."""
        self.console.problem(f"{error} {self.journal.saved_message()}")

    def watch_foot(self) -> FootKeys:
        """Return a detector of double taps of the foot, if enabled in rig.toml."""
        is_wanted = self.rig.settings.rig.operator.double_tap
        return FootKeys(self.loop_client, is_wanted=is_wanted)

    def append(self, event: Event, **details: object) -> None:
        """Append an event to the journal while the console keeps its heartbeat.

        The console keeps watching the arm even if the disk is slow.

        Raises:
            SessionError, TrialFileError: as `Journal.append`.
        """
        self.console_loop.run_in_background(
            lambda: self.journal.append(event, **details)
        )

    def record_verdict(self, event: Event, name: TrialName, reason: str) -> None:
        """Append a verdict to the journal, which updates the files of the trial."""
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


@dataclass(frozen=True, slots=True)
class RunContext(RunServices):
    """One opening of a session, from activation to the arm at rest.

    Attributes:
        state: its changing state.
    """

    state: FlowState = field(default_factory=FlowState)

    def say_page(self, lines: Iterable[str]) -> None:
        """Print lines that can be viewed again."""
        self.state.page = tuple(lines)
        for line in self.state.page:
            self.say(line)

    def report_fault(self, verdict: GuardVerdict) -> None:
        """Print `fault_text` of a verdict."""
        self.console.problem(self.fault_text(verdict))

    def fault_text(self, verdict: GuardVerdict) -> str:
        """Message on why the guard stopped the arm, and on what is safe."""
        bus = self.loop_client.loop.bus_condition
        faults = self.console_loop.faults
        is_rehearsed = faults is not None and faults.were_planned
        load = busy_load(self.rig, is_rehearsed=is_rehearsed)
        context = replace(
            self.state.fault_context,
            bus=bus,
            load=load,
            state=self.loop_client.status.state,
        )
        if self.journal.state.is_complete:  # neither a trial nor `resume` follows
            prompt = None if context.prompt is Prompt.READY else context.prompt
            context = replace(context, prompt=prompt, command=REPORT)
        return fault_text(verdict, context, self.journal.saved_message())

    def clear_faults(self, fault: ArmFaultError) -> None:
        """Report a fault that leaves the arm holding, and clear it.

        Raises:
            ArmFaultError: the arm is not under control: no trial can follow.
        """
        verdict = self.console_loop.worst_verdict(fault.verdict)
        if verdict.ends_session:
            raise ArmFaultError(verdict) from fault
        self.report_fault(verdict)
        self.console_loop.clear_faults(verdict)

    def update_estimate(self) -> None:
        """Estimate the duration once, after the first kept trial."""
        left = self.time_left
        if self.state.estimate is None and left is not None:
            self.state.estimate = self.elapsed + left

    def open_undo(self, name: TrialName, reason: str, *, is_kept: bool) -> None:
        """Print the verdict given and allow its undo for 10 s."""
        text = f"{name.kept} kept" if is_kept else f"{name.kept} rejected: {reason}"
        if self.state.is_last:  # the session ends now
            self.state.given = None
            self.say(f"{text}.")
            return
        self.state.given = GivenVerdict(name, is_kept, text)
        self.console_loop.undo_until_ns = self.rig.clock.now_ns() + UNDO_NS
        self.say(f"{text}. [u] within {UNDO_NS * 1e-9:.0f} s takes this back.")

    def change_verdict(
        self, given: GivenVerdict, *, is_kept: bool, reason: str
    ) -> None:
        """Replace a given verdict; an equal one changes nothing.

        The change is one entry of the journal: if the program dies before it, the given
        verdict stands, and no kept trial is lost.
        """
        name = given.name
        if is_kept and given.is_kept:
            self.say(f"{name.kept} stays kept.")
            return
        self.append(
            Event.VERDICT,
            trial=name.number,
            attempt=name.attempt,
            verdict=KEEP if is_kept else REJECT,
            reason=reason or "taken back within seconds",
            who=self.metadata.operator,
        )
        self.open_undo(name, reason, is_kept=is_kept)

    def close_undo(self) -> GivenVerdict | None:
        """Return the newest verdict and end its undo."""
        given, self.state.given = self.state.given, None
        self.console_loop.undo_until_ns = 0
        return given


def busy_load(rig: Rig, *, is_rehearsed: bool) -> ComputerLoad | None:
    """Return the computer's load if it explains a late simulation, else None.

    Only for a simulation in real time without planned faults, on overloaded cores.
    """
    if not rig.is_simulated or rig.is_stepped or is_rehearsed:
        return None
    load = ComputerLoad.now()
    return load if load.is_too_much else None


def open_context(
    console_loop: ConsoleLoop,
    metadata: SessionMetadata,
    journal: Journal,
) -> RunContext:
    """Return the context of a session opened now."""
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
    )
