"""The console loop: time passes, keys and stops are read, rehearsed faults injected."""

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
REFRESH_NS = 125_000_000  # between two pictures of the live screen
DAMP_SECONDS = 0.2  # between an urgent stop and idle
_OWN_QUIT = frozenset({Prompt.REVIEW, Prompt.READY})  # [q] has a meaning of its own
# Nothing is wanted of the arm.
_AT_REST = frozenset(
    {Prompt.REVIEW, Prompt.PAUSED, Prompt.DAMPED, Prompt.UNDO, Prompt.LAY_DOWN}
)
_DAMPED = "ARM: damped where it is. [space] once you hold it: then it holds again."
# Faults after which no hand is to lead the arm by what is known of its place.
_LED_ASTRAY = frozenset(
    {
        Fault.REPLIES_LATE,
        Fault.POSITION_JUMP,
        Fault.CAN_SILENCE,
        Fault.PUCK_CHANGED,
        Fault.PUCK_DOUBLED,
    }
)
# Of an arm whose motors work.
_DRIVEN = frozenset({ArmState.FLOAT, ArmState.HOLD, ArmState.DAMP, ArmState.GUIDE})
LAY_DOWN_SECONDS = 60.0  # the arm waits so long for a hand before it goes idle
# At these simulated time decides what comes next, not a key.
_WORLD_ACTS = frozenset({Prompt.RECORDING, Prompt.MOVING, Prompt.LIFT, Prompt.UNDO})
_SETTLED_NS = 2_000_000_000  # at any other, it is at rest so long after the hand
_REST_TICKS = 50  # of the wall to one of a world at rest
_SLOW = 0.95  # of real time; below it the screen says so
_ON_STAND = 0.1  # rad
_STANDS = 0.3  # s, in which an arm that holds has come to rest
_SUPPORT = "Support the arm: it goes idle and sinks slowly. [i]dle"
_LAY_DOWN = "Lay the foot onto its stand: the arm goes idle and sinks slowly. [i]dle"
_NOBODY = f"No answer for {LAY_DOWN_SECONDS:.0f} s: the arm goes idle. Support it."
_TOO_LATE = "No verdict to take back. Any trial, any time: traction verdict --help"
_T = TypeVar("_T")
View = Callable[[int], list[str]]


@dataclass(slots=True)
class ConsoleLoop:
    """Lets time pass for rig, operator and screen together, 20 ms at a time.

    Attributes:
        rig: the rig, its loop running.
        console: where everything is printed.
        operator: answers the prompts.
        stop: requests to stop.
        hand: of a simulated operator; None where a person moves the arm.
        faults: to be injected into a rehearsal; None on a real rig.
        undo_until_ns: until when the newest verdict can be taken back [ns].
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
    _prompt_ns: int = field(default=0, init=False)  # when `_prompt` began
    _acted_ns: int = field(default=0, init=False)  # newest key, move, prompt
    _rests: int = field(default=0, init=False)  # ticks since
    _rested_ns: int = field(default=0, init=False)  # in which simulated time stood
    _is_stopped: bool = field(default=False, init=False)
    _told: set[Fault | None] = field(  # faults that persist
        default_factory=set[Fault | None], init=False
    )

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
        """Let 20 ms pass and return the key pressed, "" for none.

        Raises:
            ArmFaultError: the guard stopped the arm. Where nothing is wanted of the
                arm, a fault that persists is raised once: keys are read again.
            StopRequestedError: a stop was requested; at the review `StopFlag` says so.
            UndoRequestedError: the newest verdict is taken back, in time.
            TractionError: a process or the disk failed.
        """
        state = self._advance(prompt, name, is_complete=is_complete)
        if self.stop.count and prompt is not Prompt.REVIEW:
            raise StopRequestedError
        key = self.operator.answer(state)
        if key:
            self._act()
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
        """How long the newest verdict can still be taken back [s], 0 = not any more."""
        return max(0.0, (self.undo_until_ns - self.rig.clock.now_ns()) * 1e-9)

    def line(self, name: TrialName) -> str | None:
        """Let 20 ms pass; return a note once typed, "" if given up, None before.

        Raises:
            ArmFaultError, TractionError: as `tick`.
        """
        state = self._advance(Prompt.NOTE, name)
        if self.stop.count:
            return ""
        return self.operator.line(state)

    def _pass_time(self, prompt: Prompt) -> None:
        """Let 20 ms pass, or let them pass on the wall only.

        A person may read a prompt for minutes. What the simulated world does at it is
        done soon after its hand is; from then on its time goes at a small share of
        real time, which costs as little and runs into no limit.
        """
        pace = self.rig.pace
        if pace is not None and is_person(self.operator) and self._rests_at(prompt):
            self._rests += 1
            if self._rests % _REST_TICKS:
                pace.rest(TICK)
                self._rested_ns += round(TICK * 1e9)
                return
        self.loop_client.advance(TICK)

    def _rests_at(self, prompt: Prompt) -> bool:
        """Return whether the simulated world has nothing left to do at `prompt`."""
        simulation = self.rig.simulation
        is_led = simulation is not None and not simulation.is_hand_done
        if self._prompt is None or prompt is not self._prompt[0] or is_led:
            self._act()
        waited_ns = self.rig.clock.now_ns() - self._acted_ns
        return prompt not in _WORLD_ACTS and waited_ns >= _SETTLED_NS

    def _act(self) -> None:
        """Let the simulated world go on: there is something to do, or a key."""
        self._acted_ns, self._rests = self.rig.clock.now_ns(), 0

    def _advance(
        self, prompt: Prompt, name: TrialName | None, *, is_complete: bool = False
    ) -> PromptState:
        """Let 20 ms pass and return the prompt, which the simulated hand follows."""
        self._pass_time(prompt)
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
        """Raise what the guard found while nothing was asked of the arm.

        Raises:
            ArmFaultError: it did.
        """
        control = self.loop_client.status
        if self.loop_client.is_news(control):
            raise self._fault(control)

    def _raise_fault(self, prompt: Prompt) -> None:
        """Raise the guard's strictest verdict, unless it is told and only persists."""
        control = self.loop_client.status
        if control.verdict is None or prompt not in _AT_REST:
            self._told.clear()
        if control.verdict is None:
            return
        is_told = control.verdict.fault in self._told
        fault = self._fault(control)
        if not is_told:
            raise fault

    def _fault(self, control: ControlStatus) -> ArmFaultError:
        """Return the strictest verdict that stands, to be told; tell the others."""
        strictest, *others = control.standing
        for verdict in others:
            self._tell_besides(verdict)
        self._told.add(strictest.fault)
        self.loop_client.note(control)
        return ArmFaultError(strictest)

    def _tell_besides(self, verdict: GuardVerdict) -> None:
        """Say a fault that is not the strictest, once while it persists."""
        if verdict.fault not in self._told:
            self._told.add(verdict.fault)
            self.console.say(f"{WARNING} {fault_words(verdict)}")

    def show(self, view: View | None) -> None:
        """Show what `view(width)` returns eight times a second, None for nothing."""
        self._view = view
        self._shown_ns = 0
        self.console.end_panel()

    def _refresh(self) -> None:
        now_ns = self.rig.clock.now_ns() + self._rested_ns
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
        """Inject the rehearsed faults that are due in trial `number`."""
        if self.faults is not None:
            self.faults.inject_due(moment, number, seconds)

    def worst_verdict(self, verdict: GuardVerdict) -> GuardVerdict:
        """Return `verdict`, or the guard's strictest one where that is stricter.

        A fault that persists may cost the arm while a trial is being sealed. The milder
        one is told here, and every fault that came besides.
        """
        self.loop_client.advance(TICK)
        control = self.loop_client.status
        if control.verdict is None:
            return verdict
        strictest = self._fault(control).verdict
        is_worse = strictest.strictness > verdict.strictness
        worst, milder = (strictest, verdict) if is_worse else (verdict, strictest)
        if milder.fault is not worst.fault:
            self._told.discard(milder.fault)
            self._tell_besides(milder)
        return worst

    def clear_faults(self, verdict: GuardVerdict = OK) -> None:
        """Clear rehearsed faults, and the guard's `verdict` with them; the arm holds.

        An arm that is damped after a fault of motion stays so until the operator has
        it: only a person knows whether somebody pushed, and whether it is safe.

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

    def run_aside(self, work: Callable[[], _T]) -> _T:
        """Return what slow `work` returns; the console's heartbeat goes on meanwhile.

        Raises:
            Exception: what `work` raises.
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
        """Hold; after an urgent request, damp for a moment and idle, once."""
        if not self.stop.is_urgent:
            self.loop_client.request(ArmState.HOLD)
        elif not self._is_stopped:
            self._is_stopped = True
            self.loop_client.request(ArmState.DAMP)
            self.loop_client.advance(DAMP_SECONDS)
            self.loop_client.watch_trial(is_recording=False)  # it ends with the power
            self.loop_client.request(ArmState.IDLE)
            self.loop_client.advance(TICK)

    def lay_down(self) -> None:
        """Have the arm supported before it goes idle, for then it sinks.

        It stands still, weakly enough for a hand that carries the foot onto its stand;
        an arm that is damped for its motion stays so before somebody has it. Without
        an answer, or at a request to stop, it goes idle all the same; at once after an
        urgent one, however it came to be here.
        """
        loop_client = self.loop_client
        is_driven = loop_client.status.state in _DRIVEN
        is_shorted = self.rig.backend.safety_mode() in SHORTED
        if not is_driven or is_shorted or self.console.is_lost:
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
            loop_client.advance(_STANDS)
            if loop_client.status.state is ArmState.DAMP:
                self.console.say(_DAMPED)
                if not self._await_hand(Prompt.DAMPED, lambda: True):
                    return
            if verdict is not None and verdict.fault in _LED_ASTRAY:
                rest = None
            else:
                loop_client.request(ArmState.GUIDE)
            self.console.say(_SUPPORT if rest is None else _LAY_DOWN)
            self._await_hand(Prompt.LAY_DOWN, lambda: self._lies(rest))
        except ArmFaultError as fault:  # the arm is idled at once
            self.console.problem(fault_words(fault.verdict))
        except TractionError:
            return  # the arm is not under control: it is idled at once

    def _await_hand(self, prompt: Prompt, is_done: Callable[[], bool]) -> bool:
        """Return whether the operator says so and it is done, not stopped, in time."""
        requests = self.stop.count
        for _ in range(round(LAY_DOWN_SECONDS / TICK)):
            state = self._advance(prompt, None)
            key = self.operator.answer(state)
            if key_action(prompt, key) is KeyAction.CONFIRM and is_done():
                return True
            is_stopped = self.stop.count > requests or self.stop.is_urgent
            if is_stopped or self.console.is_lost:
                return False
        self.console.say(_NOBODY)
        return False

    def _lies(self, rest: Sequence[float] | None) -> bool:
        """Return whether the foot is on its stand, as far as that is known."""
        if rest is None:
            return True
        q = self.loop_client.latest()["position"][0]
        apart = np.abs(q - np.array(rest))
        joint = int(apart.argmax())
        if apart[joint] <= _ON_STAND:
            return True
        self.console.say(
            f"Joint {joint + 1} is {apart[joint]:.2f} rad from where the foot lies on "
            "its stand (arm.rest). Lay it there, then [i]dle; Ctrl-C: idle all the "
            "same."
        )
        return False

    def make_safe(self) -> bool:
        """Idle the arm and abandon an open file; return whether idle is confirmed.

        What the loop finds in that is told: a puck may have missed it.
        """
        backend = self.rig.backend
        backend.recorder.abandon()
        is_confirmed = backend.idle()
        if not self.loop_client.loop.is_running:
            return is_confirmed
        with suppress(TractionError):
            self.loop_client.advance(TICK)
            control = self.loop_client.status
            if self.loop_client.is_news(control):
                self.console.problem(fault_words(self._fault(control).verdict))
        return is_confirmed
