"""State machine of the arm as one transition table."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, IntEnum

from acquisition.control_loop.faults import Action, GuardVerdict
from acquisition.devices import SafetyMode


class ArmState(IntEnum):
    """State of the arm.

    IDLE: windings shorted, confirmed; the arm is damped and sinks. FLOAT: gravity
    compensation and virtual mass, as in a trial. HOLD: keeps its position. DAMP: the
    same after a motion fault. UNKNOWN: idle was requested but not confirmed. GUIDE:
    keeps its position with half the torque, to be led by hand to the next trial.
    """

    IDLE = 0
    FLOAT = 1
    HOLD = 2
    DAMP = 3
    UNKNOWN = 4
    GUIDE = 5


class ArmEvent(Enum):
    """Events that can change the state of the arm."""

    REQUEST_IDLE = "idle requested"
    REQUEST_FLOAT = "float requested"
    REQUEST_HOLD = "hold requested"
    REQUEST_DAMP = "damp requested"
    REQUEST_GUIDE = "guide requested"
    VERDICT_END_TRIAL = "verdict: end trial"
    VERDICT_HOLD = "verdict: hold"
    VERDICT_DAMP = "verdict: damp"
    VERDICT_IDLE = "verdict: idle"
    IDLE_CONFIRMED = "idle confirmed"
    IDLE_UNCONFIRMED = "idle not confirmed"
    CIRCUIT_IDLE = "safety circuit is idle"


REQUESTS: Mapping[ArmState, ArmEvent] = {
    ArmState.IDLE: ArmEvent.REQUEST_IDLE,
    ArmState.FLOAT: ArmEvent.REQUEST_FLOAT,
    ArmState.HOLD: ArmEvent.REQUEST_HOLD,
    ArmState.DAMP: ArmEvent.REQUEST_DAMP,
    ArmState.GUIDE: ArmEvent.REQUEST_GUIDE,
}
VERDICTS: Mapping[Action, ArmEvent] = {
    Action.END_TRIAL: ArmEvent.VERDICT_END_TRIAL,
    Action.HOLD: ArmEvent.VERDICT_HOLD,
    Action.DAMP: ArmEvent.VERDICT_DAMP,
    Action.IDLE: ArmEvent.VERDICT_IDLE,
}


@dataclass(frozen=True, slots=True)
class Transition:
    """Effect of an event in a state.

    Attributes:
        to: next state, possibly the same, which is entered again; None = no change.
        idles: the safety circuit is idled first; `IDLE_CONFIRMED` or
            `IDLE_UNCONFIRMED` follows in the same cycle.
    """

    to: ArmState | None = None
    idles: bool = False


_STAY = Transition()
_MOVABLE = (ArmState.FLOAT, ArmState.HOLD, ArmState.GUIDE)
_GO_IDLE = Transition(idles=True)


def _always(transition: Transition) -> Mapping[ArmState, Transition]:
    return dict.fromkeys(ArmState, transition)


def _only(to: ArmState, *states: ArmState) -> Mapping[ArmState, Transition]:
    """Return the row of an event that leads to `to` from `states` only."""
    return {state: Transition(to) if state in states else _STAY for state in ArmState}


_ROWS: Mapping[ArmEvent, Mapping[ArmState, Transition]] = {
    ArmEvent.REQUEST_IDLE: _always(_GO_IDLE),
    # A state may be entered again: the law then starts from the present pose.
    ArmEvent.REQUEST_FLOAT: _always(Transition(ArmState.FLOAT)),
    ArmEvent.REQUEST_HOLD: _always(Transition(ArmState.HOLD)),
    ArmEvent.REQUEST_DAMP: _always(Transition(ArmState.DAMP)),
    ArmEvent.REQUEST_GUIDE: _always(Transition(ArmState.GUIDE)),
    ArmEvent.VERDICT_END_TRIAL: _always(_STAY),
    # A verdict never weakens an earlier reaction and never drives an idle arm.
    # Hold is entered from hold, too, because it ends a move.
    ArmEvent.VERDICT_HOLD: _only(ArmState.HOLD, *_MOVABLE),
    ArmEvent.VERDICT_DAMP: _only(ArmState.DAMP, *_MOVABLE),
    ArmEvent.VERDICT_IDLE: _always(_GO_IDLE),
    ArmEvent.IDLE_CONFIRMED: _always(Transition(ArmState.IDLE)),
    ArmEvent.IDLE_UNCONFIRMED: _always(Transition(ArmState.UNKNOWN)),
    # Late confirmation of idle. (While the arm is powered the guard reacts to the
    # circuit.) Idling again replaces the torques in the pucks by zero.
    ArmEvent.CIRCUIT_IDLE: {
        state: _GO_IDLE if state is ArmState.UNKNOWN else _STAY for state in ArmState
    },
}
TRANSITIONS: Mapping[tuple[ArmState, ArmEvent], Transition] = {
    (state, event): _ROWS[event][state] for state in ArmState for event in ArmEvent
}


def transition_lines() -> list[str]:
    """Return the transition table as text, one line per state and event."""
    lines: list[str] = []
    for (state, event), transition in TRANSITIONS.items():
        result = "-"
        if transition.idles:
            result = "idle is asked for, then idle confirmed or idle not confirmed"
        elif transition.to is not None:
            result = f"-> {transition.to.name.lower()}"
        lines.append(f"{state.name.lower():<8} {event.value:<25} {result}")
    return lines


@dataclass(slots=True)
class ControlStatus:
    """Status of the loop for the console.

    Attributes:
        state: state of the arm.
        safety: state of the safety circuit.
        verdict: strictest active verdict, or None.
        ft_age_ns: age of the force sample [ns].
        number: number of verdicts so far; a request states the newest it knows.
        others: other active verdicts, the strictest first.
    """

    state: ArmState = ArmState.IDLE
    safety: SafetyMode = SafetyMode.UNKNOWN
    verdict: GuardVerdict | None = None
    ft_age_ns: int = 0
    number: int = 0
    others: tuple[GuardVerdict, ...] = ()

    @property
    def active_verdicts(self) -> tuple[GuardVerdict, ...]:
        """All active verdicts, the strictest first."""
        return () if self.verdict is None else (self.verdict, *self.others)

    @property
    def is_idled(self) -> bool:
        """Whether an active verdict idles the arm."""
        return any(verdict.action is Action.IDLE for verdict in self.active_verdicts)

    def latch(self, verdict: GuardVerdict) -> None:
        """Activate a verdict unless its fault is active with at least its severity."""
        standing = self.active_verdicts
        if any(
            verdict.fault is other.fault and verdict.severity <= other.severity
            for other in standing
        ):
            return
        kept = [other for other in standing if other.fault is not verdict.fault]
        # reverse=True keeps the sort stable: of equally strict ones the earliest first.
        self.verdict, *others = sorted(
            [*kept, verdict], key=lambda v: v.strictness, reverse=True
        )
        self.others = tuple(others)
        self.number += 1

    def clear(self) -> None:
        """Clear all verdicts."""
        self.verdict, self.others = None, ()
