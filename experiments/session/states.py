"""State machine of a session: one table of (phase, event) to next phase."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum


class SessionPhase(StrEnum):
    """Phase of a session."""

    PLANNED = "planned"
    PREFLIGHT = "preflight"
    READY = "ready"
    RECORDING = "recording"
    REVIEW = "review"
    PAUSED = "paused"
    UNFINISHED = "unfinished"
    COMPLETE = "complete"
    CLOSED = "closed"
    CRASHED = "crashed"


class Event(StrEnum):
    """Event in the journal."""

    STARTED = "session-started"
    RESUMED = "session-resumed"
    REDO = "redo-started"
    ACTIVATED = "activated"
    TARED = "tared"
    PAUSED = "paused"
    CONTINUED = "continued"
    SET_ASIDE = "trial-set-aside"
    TRIAL_STARTED = "trial-started"
    TRIAL_RECORDED = "trial-recorded"
    TRIAL_KEPT = "trial-kept"
    TRIAL_REJECTED = "trial-rejected"
    VERDICT = "verdict-changed"
    NOTED = "noted"
    ENDED = "session-ended"
    GIVEN_UP = "session-closed"
    CRASH_FOUND = "crash-found"


@dataclass(frozen=True, slots=True)
class PhaseChange:
    """Effect of an event in a phase.

    Attributes:
        to: possible next phases; of two, the kept trials decide which.
        refused: why the event is not allowed; empty if it is.
    """

    to: tuple[SessionPhase, ...] = ()
    refused: str = ""


OPEN = frozenset(
    {
        SessionPhase.PREFLIGHT,
        SessionPhase.READY,
        SessionPhase.RECORDING,
        SessionPhase.REVIEW,
        SessionPhase.PAUSED,
    }
)
RESUMABLE = frozenset({SessionPhase.UNFINISHED, SessionPhase.CRASHED})
_AT_REST = (SessionPhase.UNFINISHED, SessionPhase.COMPLETE)
_Transitions = Mapping[SessionPhase, tuple[SessionPhase, ...]]


def _stay(*phases: SessionPhase) -> _Transitions:
    return {phase: (phase,) for phase in phases}


def _lead(to: SessionPhase, *phases: SessionPhase) -> _Transitions:
    return dict.fromkeys(phases, (to,))


_TRANSITIONS: Mapping[Event, _Transitions] = {
    Event.STARTED: _lead(SessionPhase.PREFLIGHT, SessionPhase.PLANNED),
    Event.RESUMED: _lead(SessionPhase.PREFLIGHT, *RESUMABLE, SessionPhase.CLOSED),
    Event.REDO: _lead(
        SessionPhase.PREFLIGHT, *RESUMABLE, SessionPhase.CLOSED, SessionPhase.COMPLETE
    ),
    Event.ACTIVATED: _lead(SessionPhase.READY, SessionPhase.PREFLIGHT),
    Event.TARED: _stay(SessionPhase.READY),
    Event.PAUSED: _lead(SessionPhase.PAUSED, SessionPhase.READY),
    Event.CONTINUED: _lead(SessionPhase.READY, SessionPhase.PAUSED),
    Event.SET_ASIDE: _stay(SessionPhase.READY),
    Event.TRIAL_STARTED: _lead(SessionPhase.RECORDING, SessionPhase.READY),
    Event.TRIAL_RECORDED: _lead(SessionPhase.REVIEW, SessionPhase.RECORDING),
    Event.TRIAL_KEPT: _lead(SessionPhase.READY, SessionPhase.REVIEW),
    Event.TRIAL_REJECTED: {
        **_lead(SessionPhase.READY, SessionPhase.RECORDING, SessionPhase.REVIEW),
        **_stay(SessionPhase.CRASHED),
    },
    Event.VERDICT: {
        SessionPhase.READY: (SessionPhase.READY,),  # taken back within seconds
        SessionPhase.UNFINISHED: _AT_REST,
        SessionPhase.COMPLETE: _AT_REST,
        SessionPhase.CLOSED: (SessionPhase.CLOSED, SessionPhase.COMPLETE),
        SessionPhase.CRASHED: (SessionPhase.CRASHED,),
    },
    Event.NOTED: _stay(
        *(phase for phase in SessionPhase if phase is not SessionPhase.PLANNED)
    ),
    Event.ENDED: {
        **dict.fromkeys(
            (
                SessionPhase.PREFLIGHT,
                SessionPhase.READY,
                SessionPhase.PAUSED,
                SessionPhase.CRASHED,
            ),
            _AT_REST,
        ),
        # A trial left without a verdict counts as a crash.
        **_lead(SessionPhase.CRASHED, SessionPhase.RECORDING, SessionPhase.REVIEW),
    },
    Event.GIVEN_UP: _lead(SessionPhase.CLOSED, *RESUMABLE),
    Event.CRASH_FOUND: _lead(SessionPhase.CRASHED, *OPEN),
}

_WHY: Mapping[SessionPhase, str] = {
    SessionPhase.PLANNED: "the session has not been started",
    SessionPhase.PREFLIGHT: "the arm is not active yet",
    SessionPhase.READY: "no trial is running",
    SessionPhase.RECORDING: "a trial is being recorded",
    SessionPhase.REVIEW: "a trial waits for its verdict",
    SessionPhase.PAUSED: "the session is paused",
    SessionPhase.UNFINISHED: "the session is not open: traction resume",
    SessionPhase.COMPLETE: "the session is complete",
    SessionPhase.CLOSED: "the session was closed",
    SessionPhase.CRASHED: "the session ended without closing: traction resume",
}
_OPENING = frozenset({Event.STARTED, Event.RESUMED, Event.REDO, Event.GIVEN_UP})


def _step(phase: SessionPhase, event: Event) -> PhaseChange:
    to = _TRANSITIONS[event].get(phase, ())
    if to:
        return PhaseChange(to)
    if event is Event.STARTED and phase is not SessionPhase.PLANNED:
        return PhaseChange(refused="the session was started before")
    if phase in OPEN and event in _OPENING | {Event.VERDICT}:
        return PhaseChange(refused="the session is open")
    return PhaseChange(refused=_WHY[phase])


TABLE: Mapping[tuple[SessionPhase, Event], PhaseChange] = {
    (phase, event): _step(phase, event) for phase in SessionPhase for event in Event
}


def table_lines() -> list[str]:
    """Return the table as text: one line per pair, phase by phase."""
    lines: list[str] = []
    for (phase, event), step in TABLE.items():
        result = f"refused: {step.refused}"
        if step.to:
            result = "-> " + " or ".join(step.to)
        lines.append(f"{phase:<11} {event:<16} {result}")
    return lines
