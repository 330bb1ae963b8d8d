"""The stage: time passes, keys and stops are heard, rehearsed faults come and go."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TypeVar

from acquisition.control_loop.faults import GuardVerdict
from acquisition.control_loop.states import ArmState
from acquisition.ipc.loop_client import LoopClient
from experiments.fault_injection.plan import FaultTrigger
from experiments.operator.prompts import Prompt, PromptState
from experiments.rig.rig import Rig
from experiments.run.participants import ArmFaultError, Company, StopRequestedError
from experiments.trial.header import TrialName

TICK = 0.02  # the console looks this often [s]
REFRESH_NS = 125_000_000  # between two pictures of the live screen
DAMP_SECONDS = 0.2  # between an urgent stop and the brakes
_OWN_QUIT = frozenset({Prompt.REVIEW, Prompt.READY})  # [q] means something else
_AT_REST = frozenset({Prompt.REVIEW, Prompt.PAUSED})  # nothing is wanted of the arm
_T = TypeVar("_T")


@dataclass(slots=True)
class ConsoleLoop:
    """Rig, loop and company of a session, and the passing of time between them."""

    rig: Rig
    company: Company
    view: Callable[[int], list[str]] | None = None
    _shown_ns: int = 0
    _asked: tuple[Prompt, int, int] | None = None
    _asked_at: int = 0
    _is_stopped: bool = False
    _known: str = ""  # reason of a fault that was told and goes on

    @property
    def control(self) -> LoopClient:
        """The console's side of the loop."""
        return self.rig.backend.loop_client

    def tick(
        self,
        prompt: Prompt,
        name: TrialName | None = None,
        *,
        is_complete: bool = False,
    ) -> str:
        """Let 20 ms pass; return the key pressed, raise what stops everything.

        Raises:
            FaultedError: the guard stopped the arm. Where nothing is wanted of the arm,
                a fault that goes on is raised once: keys are heard again.
            StopAskedError: a stop was asked for; at the review `StopFlag` says so.
            TractionError: a process or the disk is in trouble.
        """
        asked = self._pass(prompt, name, is_complete=is_complete)
        if self.company.stop.count and prompt is not Prompt.REVIEW:
            raise StopRequestedError
        key = self.company.keys.answer(asked)
        if key == "q" and prompt not in _OWN_QUIT:
            raise StopRequestedError
        return key

    def line(self, name: TrialName) -> str | None:
        """Let 20 ms pass; return a note as it was typed, "" given up, None before.

        Raises:
            FaultedError, TractionError: as `tick`.
        """
        asked = self._pass(Prompt.NOTE, name)
        if self.company.stop.count:
            return ""
        return self.company.keys.line(asked)

    def _pass(
        self, prompt: Prompt, name: TrialName | None, *, is_complete: bool = False
    ) -> PromptState:
        """Let 20 ms pass and return what is asked for, which the hand follows."""
        self.control.advance(TICK)
        self._show()
        self._raise_news(prompt)
        if self.company.console.is_lost:
            self.company.stop.ask()
        number, attempt = (name.number, name.attempt) if name else (0, 0)
        now = self.rig.clock.now_ns()
        if self._asked != (prompt, number, attempt):
            self._asked = (prompt, number, attempt)
            self._asked_at = now
        since = (now - self._asked_at) * 1e-9
        asked = PromptState(prompt, number, attempt, is_complete, since)
        if self.company.hand is not None:
            self.company.hand.follow(asked)
        return asked

    def _raise_news(self, prompt: Prompt) -> None:
        """Raise the guard's verdict, unless it has been told and only goes on."""
        verdict = self.control.status.verdict
        if verdict is None or prompt not in _AT_REST:
            self._known = ""
        if verdict is not None and verdict.reason != self._known:
            self._known = verdict.reason
            raise ArmFaultError(verdict)

    def look(self, view: Callable[[int], list[str]] | None) -> None:
        """Show what `view(width)` returns eight times a second, None for nothing."""
        self.view = view
        self._shown_ns = 0
        self.company.console.end_panel()

    def _show(self) -> None:
        console, now_ns = self.company.console, self.rig.clock.now_ns()
        if self.view is None or not console.is_live:
            return
        if now_ns - self._shown_ns >= REFRESH_NS:
            self._shown_ns = now_ns
            console.panel(self.view(console.width))

    def raise_faults(self, moment: FaultTrigger, number: int, seconds: float) -> None:
        """Raise rehearsed faults whose moment in trial `number` has come."""
        if self.company.faults is not None:
            self.company.faults.raise_due(moment, number, seconds)

    def worst(self, verdict: GuardVerdict) -> GuardVerdict:
        """Return `verdict`, or what the guard has said since then if that is worse.

        A fault that goes on may have taken the arm away while a trial was put away.
        """
        self.control.advance(TICK)
        newest = self.control.status.verdict
        is_worse = newest is not None and newest.severity > verdict.severity
        return newest if newest is not None and is_worse else verdict

    def clear_faults(self) -> None:
        """Let a rehearsed fault go, and the guard's verdict with it."""
        if self.rig.simulation is not None:
            self.rig.simulation.clear_faults()
        self.control.request(ArmState.HOLD)
        self.control.advance(0.1)

    def aside(self, work: Callable[[], _T]) -> _T:
        """Do slow work while the loop goes on to see that the console is alive."""
        if self.rig.is_stepped:
            return work()
        with ThreadPoolExecutor(1) as pool:
            future = pool.submit(work)
            while not future.done():
                self.control.advance(TICK)
                if self.company.stop.is_urgent:
                    self.obey_stop()
            return future.result()

    def obey_stop(self) -> None:
        """Hold; when asked twice within 3 s, damp for a moment and brake, once."""
        if not self.company.stop.is_urgent:
            self.control.request(ArmState.HOLD)
        elif not self._is_stopped:
            self._is_stopped = True
            self.control.request(ArmState.DAMP)
            self.control.advance(DAMP_SECONDS)
            self.control.request(ArmState.IDLE)
            self.control.advance(TICK)

    def leave(self) -> None:
        """End the session on purpose.

        Raises:
            StopAskedError: always; the way out is the one of Ctrl-C.
        """
        raise StopRequestedError

    def make_safe(self) -> bool:
        """Idle the arm and let go of an open file; return whether it is confirmed."""
        backend = self.rig.backend
        backend.recorder.abandon()
        return backend.idle()
