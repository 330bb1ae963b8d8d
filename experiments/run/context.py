"""What the parts of a session's flow share: rig, operator, journal, progress."""

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

UNDO_NS = 10_000_000_000  # a verdict can be taken back for so long [ns]


@dataclass(frozen=True, slots=True)
class GivenVerdict:
    """A verdict that was just given.

    Attributes:
        name: of the attempt.
        is_kept: it was kept, not rejected.
        text: the verdict in words.
    """

    name: TrialName
    is_kept: bool
    text: str


@dataclass(slots=True)
class FlowState:
    """What changes while the session is open, and which step of the flow changes it.

    Attributes:
        fault_context: where in the session a fault would occur now; every step that
            waits for a person sets it.
        page: the newest review, line by line; of `say_page`.
        is_last: no trial begins after this one; of `ready` and `verdicts`.
        estimate: expected duration, as of the first kept trial [s]; of
            `update_estimate`.
        ticked: numbers of the steps of the reset that were ticked; of `ready`, cleared
            by `record`.
        given: the newest verdict, None before the first or after it was taken back; of
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
    """What the steps of one opening of a session act with; none of it is replaced.

    Attributes:
        console_loop: lets time pass.
        rig: the rig, its loop running.
        console: where everything is printed.
        operator: answers the prompts.
        stop: requests to stop.
        metadata: of the session.
        journal: events and state.
        archive: the trials' files.
        feedback: sounds and speech.
        opened_ns: when it was opened [ns].
        kept_before: how many trials were kept until then.
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
        """How long it has been open [s]."""
        return (self.rig.clock.now_ns() - self.opened_ns) * 1e-9

    @property
    def time_left(self) -> float | None:
        """Expected time for the missing trials [s]; None before the first kept one."""
        kept = len(self.journal.state.kept) - self.kept_before
        missing = self.journal.state.wanted - len(self.journal.state.kept)
        return self.elapsed / kept * missing if kept > 0 else None

    def await_trial(self) -> None:
        """Let the arm float in the hand that puts it down, until a trial begins."""
        self.loop_client.request(ArmState.FLOAT)

    def say(self, text: str) -> None:
        """Print one line."""
        self.console.say(text)

    def say_keys(self, prompt: Prompt) -> None:
        """Print the keys of `prompt`, none of them broken."""
        self.say(packed(screen_keys(prompt), self.console.width))

    def report_error(self, error: TractionError) -> None:
        """Print an error, and what is safe."""
        self.console.problem(f"{error} {self.journal.saved()}")

    def watch_foot(self) -> FootKeys:
        """Return the double tap of the foot as a key, if rig.toml wants it."""
        is_wanted = self.rig.settings.rig.operator.double_tap
        return FootKeys(self.loop_client, is_wanted=is_wanted)

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


@dataclass(frozen=True, slots=True)
class RunContext(RunServices):
    """One opening of a session, from activation to the arm at rest.

    Attributes:
        state: what changes meanwhile.
    """

    state: FlowState = field(default_factory=FlowState)

    def say_page(self, lines: Iterable[str]) -> None:
        """Print lines that can be viewed again."""
        self.state.page = tuple(lines)
        for line in self.state.page:
            self.say(line)

    def report_fault(self, verdict: GuardVerdict) -> None:
        """Print why the guard stopped the arm, and what is safe."""
        self.console.problem(self.fault_text(verdict))

    def fault_text(self, verdict: GuardVerdict) -> str:
        """Return why the guard stopped the arm, and what is safe."""
        bus = self.loop_client.loop.bus_condition
        faults = self.console_loop.faults
        is_rehearsed = faults is not None and faults.are_any
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
        self.console_loop.clear_faults(verdict)

    def update_estimate(self) -> None:
        """Estimate the duration once, when the first trial is kept."""
        left = self.time_left
        if self.state.estimate is None and left is not None:
            self.state.estimate = self.elapsed + left

    def open_undo(self, name: TrialName, reason: str, *, is_kept: bool) -> None:
        """Say which verdict was given; from now on it can be taken back for 10 s."""
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
        """Put another verdict in the place of a given one; the same changes nothing.

        It is one entry of the journal: where the program dies before it, what was
        given stands, and no kept trial is lost.
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
        """Return the newest verdict; it cannot be taken back any more."""
        given, self.state.given = self.state.given, None
        self.console_loop.undo_until_ns = 0
        return given


def busy_load(rig: Rig, *, is_rehearsed: bool) -> ComputerLoad | None:
    """Return the computer's load where it makes a simulation late, else None.

    That is on the wall clock, where no fault was asked for and programs wait for cores.
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
    )
