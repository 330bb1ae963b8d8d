"""The console's cycle: advance time, read keys and stops, inject planned faults."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np

from acquisition.control_loop.faults import OK, Action, Fault, GuardVerdict
from acquisition.control_loop.states import ArmState, ControlStatus
from acquisition.devices import SHORTED
from acquisition.errors import TractionError
from acquisition.ipc.child import ProcessLostError
from acquisition.ipc.loop_client import LoopClient
from experiments.messages import fault_words
from experiments.operator.console import WARNING, Console
from experiments.operator.keys import KeyAction, key_action
from experiments.operator.prompts import OperatorInput, Prompt, PromptState
from experiments.operator.terminal import is_person
from experiments.rig.rig import Rig
from experiments.rig.simulation import SimulatedHand
from experiments.run.fault_plan import FaultTrigger, PlannedFaults
from experiments.run.stop import (
    ArmFaultError,
    StopFlag,
    StopRequestedError,
    UndoRequestedError,
)
from experiments.session.sidecar import TrialName

TICK = 0.02  # period of the console [s]
REFRESH_NS = 125_000_000  # period of the live screen
DAMP_SECONDS = 0.2  # from an urgent stop to idle
_OWN_QUIT = frozenset({Prompt.REVIEW, Prompt.READY})  # [q] has another meaning
# Prompts at which the arm only waits.
_WAITING_PROMPTS = frozenset(
    {Prompt.REVIEW, Prompt.PAUSED, Prompt.DAMPED, Prompt.UNDO, Prompt.LAY_DOWN}
)
_DAMPED = "ARM: damped where it is. [space] once you hold it: then it holds again."
# Faults after which the measured pose is not reliable enough to lead the arm.
_POSE_UNRELIABLE = frozenset(
    {
        Fault.REPLIES_LATE,
        Fault.POSITION_JUMP,
        Fault.CAN_SILENCE,
        Fault.PUCK_CHANGED,
        Fault.PUCK_DOUBLED,
    }
)
# States in which the motors are driven.
_DRIVEN = frozenset({ArmState.FLOAT, ArmState.HOLD, ArmState.DAMP, ArmState.GUIDE})
LAY_DOWN_SECONDS = 60.0  # the arm waits this long for the operator, then goes idle
# Prompts that end by themselves after simulated time.
_TIMED_PROMPTS = frozenset({Prompt.RECORDING, Prompt.MOVING, Prompt.LIFT, Prompt.UNDO})
_PAUSE_AFTER_NS = 2_000_000_000  # idle time at the other prompts
_PAUSED_TICKS = 50  # real ticks per simulated tick while paused
_SLOW = 0.95  # simulation speed below which the screen warns, 1 = real time
_STAND_TOLERANCE = 0.1  # rad
_SETTLE_SECONDS = 0.3  # s until an arm in hold stands still
_SUPPORT = "Support the arm: it goes idle and sinks slowly. [i]dle"
_LAY_DOWN = "Lay the foot onto its stand: the arm goes idle and sinks slowly. [i]dle"
_NO_ANSWER = f"No answer for {LAY_DOWN_SECONDS:.0f} s: the arm goes idle. Support it."
_TOO_LATE = "No verdict to take back. Any trial, any time: traction verdict --help"
_T = TypeVar("_T")
View = Callable[[int], list[str]]


@dataclass(slots=True)
class ConsoleLoop:
    """Advances rig, operator and screen together in steps of 20 ms.

    Attributes:
        rig: the rig, its loop running.
        console: output.
        operator: answers the prompts.
        stop: requests to stop.
        hand: hand of a simulated operator; None if a person moves the arm.
        faults: planned faults of a rehearsal; None on a real rig.
        undo_until_ns: time until which the newest verdict can be undone [ns].
    """

    rig: Rig
    console: Console
    operator: OperatorInput
    stop: StopFlag
    hand: SimulatedHand | None = None
    faults: PlannedFaults | None = None
    undo_until_ns: int = 0
    _view: View | None = field(default=None, init=False)
    _shown_ns: int = field(default=0, init=False)
    _prompt: tuple[Prompt, int, int] | None = field(default=None, init=False)
    _prompt_ns: int = field(default=0, init=False)  # start of `_prompt`
    _acted_ns: int = field(default=0, init=False)  # last key, move, prompt
    _paused_ticks: int = field(default=0, init=False)  # since `_acted_ns`
    _paused_ns: int = field(default=0, init=False)  # real time spent paused
    _is_stopped: bool = field(default=False, init=False)
    _reported: set[Fault | None] = field(  # faults that persist
        default_factory=set[Fault | None], init=False
    )
    # strictest verdict that was raised and not cleared
    _standing: GuardVerdict | None = field(default=None, init=False)

    @property
    def loop_client(self) -> LoopClient:
        """The console's side of the loop."""
        return self.rig.backend.loop_client

    def tick(
        self,
        prompt: Prompt,
        name: TrialName | None = None,
        *,
        is_complete: bool = False,
    ) -> str:
        """Advance by 20 ms; returns the key pressed, "" for none.

        Raises:
            ArmFaultError: the guard stopped the arm. While the arm has nothing to do,
                a persistent fault is raised only once, so that keys are read again.
            StopRequestedError: a stop was requested; not at the review, see
                `StopFlag`.
            UndoRequestedError: the operator undoes the newest verdict in time.
            TractionError: a process or the disk failed.
        """
        state = self._advance(prompt, name, is_complete=is_complete)
        if self.stop.count and prompt is not Prompt.REVIEW:
            raise StopRequestedError
        key = self.operator.answer(state)
        if key:
            self._resume_simulation()
        if key == "q" and prompt not in _OWN_QUIT:
            raise StopRequestedError
        if key_action(prompt, key) is KeyAction.UNDO:
            if self.undo_left > 0.0:
                raise UndoRequestedError
            self.console.say(_TOO_LATE)
            return ""
        return key

    @property
    def undo_left(self) -> float:
        """Remaining time to undo the newest verdict [s], 0 = expired."""
        return max(0.0, (self.undo_until_ns - self.rig.clock.now_ns()) * 1e-9)

    def poll_note(self, name: TrialName) -> str | None:
        """Advance by 20 ms; return the note, "" if cancelled, None while it is typed.

        Raises:
            ArmFaultError, TractionError: as `tick`.
        """
        state = self._advance(Prompt.NOTE, name)
        if self.stop.count:
            return ""
        return self.operator.line(state)

    def _advance_time(self, prompt: Prompt) -> None:
        """Advance by 20 ms, or only wait 20 ms while the simulation is paused.

        A person may read a prompt for minutes. Meanwhile simulated time runs at 1/50 of
        real time, which saves load and avoids time-outs.
        """
        pace = self.rig.pace
        if pace is not None and is_person(self.operator) and self._update_pause(prompt):
            self._paused_ticks += 1
            if self._paused_ticks % _PAUSED_TICKS:
                pace.rest(TICK)
                self._paused_ns += round(TICK * 1e9)
                return
        self.loop_client.advance(TICK)

    def _update_pause(self, prompt: Prompt) -> bool:
        """Return whether time is paused; a new prompt or a motion resumes it."""
        simulation = self.rig.simulation
        is_moving = simulation is not None and not simulation.is_hand_done
        if self._prompt is None or prompt is not self._prompt[0] or is_moving:
            self._resume_simulation()
        waited_ns = self.rig.clock.now_ns() - self._acted_ns
        return prompt not in _TIMED_PROMPTS and waited_ns >= _PAUSE_AFTER_NS

    def _resume_simulation(self) -> None:
        """Resume simulated time after a key or a motion."""
        self._acted_ns, self._paused_ticks = self.rig.clock.now_ns(), 0

    def _advance(
        self, prompt: Prompt, name: TrialName | None, *, is_complete: bool = False
    ) -> PromptState:
        """Advance by 20 ms; returns the prompt, which the simulated hand follows."""
        self._advance_time(prompt)
        self._refresh()
        self._raise_fault(prompt)
        if self.console.is_lost:
            self.stop.request()
        number, attempt = (name.number, name.attempt) if name else (0, 0)
        now = self.rig.clock.now_ns()
        if self._prompt != (prompt, number, attempt):
            self._prompt = (prompt, number, attempt)
            self._prompt_ns = now
        since = (now - self._prompt_ns) * 1e-9
        state = PromptState(prompt, number, attempt, is_complete, since)
        if self.hand is not None:
            self.hand.follow(state)
        return state

    def require_no_fault(self) -> None:
        """Raise a fault that occurred outside `tick`.

        Raises:
            ArmFaultError: the guard stopped the arm.
        """
        control = self.loop_client.status
        if self.loop_client.is_news(control):
            raise self._report_faults(control)

    def _raise_fault(self, prompt: Prompt) -> None:
        """Raise the guard's strictest verdict, unless reported and persistent."""
        control = self.loop_client.status
        if control.verdict is None or prompt not in _WAITING_PROMPTS:
            self._reported.clear()
        if control.verdict is None:
            return
        is_reported = control.verdict.fault in self._reported
        fault = self._report_faults(control)
        if not is_reported:
            raise fault

    def _report_faults(self, control: ControlStatus) -> ArmFaultError:
        """Return the strictest active verdict as an error; print the others."""
        strictest, *others = control.active_verdicts
        for verdict in others:
            self._print_fault(verdict)
        self._reported.add(strictest.fault)
        self.loop_client.note(control)
        standing = self._standing
        if standing is None or strictest.strictness > standing.strictness:
            self._standing = strictest
        return ArmFaultError(strictest)

    def _print_fault(self, verdict: GuardVerdict) -> None:
        """Print a fault other than the strictest, once while it persists."""
        if verdict.fault not in self._reported:
            self._reported.add(verdict.fault)
            self.console.say(f"{WARNING} {fault_words(verdict)}")

    def show(self, view: View | None) -> None:
        """Show the lines of `view(width)` eight times a second; None ends it."""
        self._view = view
        self._shown_ns = 0
        self.console.end_panel()

    def _refresh(self) -> None:
        now_ns = self.rig.clock.now_ns() + self._paused_ns
        if self._view is None or not self.console.is_live:
            return
        if now_ns - self._shown_ns >= REFRESH_NS:
            self._shown_ns = now_ns
            lines = self._view(self.console.width)
            pace = self.rig.pace
            if pace is not None and pace.speed < _SLOW:
                lines = [*lines, f"{pace.speed:.1f} x real time: the computer is busy"]
            self.console.panel(lines)

    def inject_faults(self, moment: FaultTrigger, number: int, seconds: float) -> None:
        """Inject the planned faults that are due in trial `number`."""
        if self.faults is not None:
            self.faults.inject_due(moment, number, seconds)

    def standing_verdict(self) -> GuardVerdict | None:
        """Return the strictest verdict that was not cleared; None = the arm is sound.

        Includes one that another error prevented from being reported.
        """
        with suppress(TractionError):  # no more control of the arm
            self.loop_client.advance(TICK)
            control = self.loop_client.status
            if self.loop_client.is_news(control):
                self._report_faults(control)
        return self._standing

    @property
    def is_carrying(self) -> bool:
        """Whether the motors carry the arm."""
        backend = self.rig.backend
        return (
            backend.is_controlled
            and self.loop_client.status.state in _DRIVEN
            and backend.safety_mode() not in SHORTED
        )

    def worst_verdict(self, verdict: GuardVerdict) -> GuardVerdict:
        """Return the stricter of `verdict` and the guard's strictest active one.

        A fault may escalate while a trial is being sealed. The milder verdict and all
        other faults are printed here.
        """
        self.loop_client.advance(TICK)
        control = self.loop_client.status
        if control.verdict is None:
            return verdict
        strictest = self._report_faults(control).verdict
        is_worse = strictest.strictness > verdict.strictness
        worst, milder = (strictest, verdict) if is_worse else (verdict, strictest)
        if milder.fault is not worst.fault:
            self._reported.discard(milder.fault)
            self._print_fault(milder)
        return worst

    def clear_faults(self, verdict: GuardVerdict = OK) -> None:
        """Clear injected faults and the guard's `verdict`; the arm holds.

        An arm damped after a motion fault stays damped until the operator confirms:
        only a person knows whether somebody pushed, and whether holding is safe.

        Raises:
            ArmFaultError: damping did not help; the arm is idle.
            StopRequestedError: as `tick`.
        """
        if self.rig.simulation is not None:
            self.rig.simulation.clear_faults()
        if verdict.action is Action.DAMP:
            self.console.say(_DAMPED)
            while self.tick(Prompt.DAMPED) != " ":
                pass
        self.loop_client.request(ArmState.HOLD)
        self.loop_client.advance(0.1)
        self._standing = None

    def run_in_background(self, work: Callable[[], _T]) -> _T:
        """Run slow `work` in a thread while the console keeps its heartbeat.

        Raises:
            Exception: whatever `work` raises.
        """
        if self.rig.is_stepped:
            return work()
        with ThreadPoolExecutor(1) as pool:
            future = pool.submit(work)
            while not future.done():
                self.loop_client.advance(TICK)
                if self.stop.is_urgent:
                    self.stop_arm()
            return future.result()

    def stop_arm(self) -> None:
        """Hold; after an urgent request, damp briefly, then idle, once."""
        if not self.stop.is_urgent:
            self.loop_client.request(ArmState.HOLD)
        elif not self._is_stopped:
            self._is_stopped = True
            self.loop_client.request(ArmState.DAMP)
            self.loop_client.advance(DAMP_SECONDS)
            self.loop_client.watch_trial(is_recording=False)  # idle ends it
            self.loop_client.request(ArmState.IDLE)
            self.loop_client.advance(TICK)

    def lay_down(self) -> None:
        """Ask the operator to support the arm before it goes idle and sinks.

        The arm stands still, compliant enough for the operator to lay the foot onto its
        stand; an arm damped for its motion stays damped until somebody holds it.
        Without an answer, or at a request to stop, it goes idle anyway; after an urgent
        request at once.
        """
        loop_client = self.loop_client
        if not self.is_carrying or self.console.is_lost:
            return
        self.show(None)
        if self.stop.is_urgent:
            self.stop_arm()
            return
        rest = self.rig.settings.rig.arm.rest
        verdict = loop_client.status.verdict
        try:
            if loop_client.status.state in {ArmState.FLOAT, ArmState.GUIDE}:
                loop_client.request(ArmState.HOLD)
            loop_client.advance(_SETTLE_SECONDS)
            if not self.is_carrying:  # a fault that stands has become worse
                return
            if loop_client.status.state is ArmState.DAMP:
                self.console.say(_DAMPED)
                if not self._await_confirmation(Prompt.DAMPED, lambda: True):
                    return
            if verdict is not None and verdict.fault in _POSE_UNRELIABLE:
                rest = None
            else:
                loop_client.request(ArmState.GUIDE)
            self.console.say(_SUPPORT if rest is None else _LAY_DOWN)
            self._await_confirmation(Prompt.LAY_DOWN, lambda: self._is_on_stand(rest))
        except ArmFaultError as fault:  # the arm is idled at once
            self.console.problem(fault_words(fault.verdict))
        except TractionError:
            return  # no control of the arm: it is idled at once

    def _await_confirmation(self, prompt: Prompt, is_done: Callable[[], bool]) -> bool:
        """Return whether the operator confirms in time and `is_done` holds.

        Nothing is left to confirm once the motors no longer carry the arm.
        """
        requests = self.stop.count
        for _ in range(round(LAY_DOWN_SECONDS / TICK)):
            state = self._advance(prompt, None)
            key = self.operator.answer(state)
            if key_action(prompt, key) is KeyAction.CONFIRM and is_done():
                return True
            is_stopped = self.stop.count > requests or self.stop.is_urgent
            if is_stopped or self.console.is_lost or not self.is_carrying:
                return False
        self.console.say(_NO_ANSWER)
        return False

    def _is_on_stand(self, rest: Sequence[float] | None) -> bool:
        """Return whether the foot is on its stand; True if the stand is unknown."""
        if rest is None:
            return True
        q = self.loop_client.latest()["position"][0]
        deviation = np.abs(q - np.array(rest))
        joint = int(deviation.argmax())
        if deviation[joint] <= _STAND_TOLERANCE:
            return True
        self.console.say(
            f"Joint {joint + 1} is {deviation[joint]:.2f} rad from where the foot lies "
            "on its stand (arm.rest). Lay it there, then [i]dle. Ctrl-C idles the arm "
            "anyway."
        )
        return False

    def make_safe(self) -> bool:
        """Idle the arm and abandon an open file; returns whether idle is confirmed.

        Other faults that the loop detects meanwhile are printed, e.g. a puck that
        missed the command.
        """
        backend = self.rig.backend
        is_confirmed = backend.idle()  # first: a recorder may not answer
        try:
            backend.recorder.abandon()
        except ProcessLostError as lost:
            self.console.problem(str(lost))
        if not self.loop_client.loop.is_running:
            return is_confirmed
        with suppress(TractionError):
            self.loop_client.advance(TICK)
            control, told = self.loop_client.status, self._standing
            if self.loop_client.is_news(control):
                verdict = self._report_faults(control).verdict
                if told is None or verdict.fault is not told.fault:
                    self.console.problem(fault_words(verdict))
        return is_confirmed
