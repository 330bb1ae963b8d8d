"""The life of a session as one table: in which phase which event leads where."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum


class Phase(StrEnum):
    """Where a session stands."""

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
    """What the journal says has happened."""

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
class Step:
    """What an event does in a phase.

    Attributes:
        to: phases it may lead to; of two, the kept trials decide which.
        refused: why it cannot happen; empty where it can.
    """

    to: tuple[Phase, ...] = ()
    refused: str = ""


OPEN = frozenset(
    {Phase.PREFLIGHT, Phase.READY, Phase.RECORDING, Phase.REVIEW, Phase.PAUSED}
)
RESUMABLE = frozenset({Phase.UNFINISHED, Phase.CRASHED})
_AT_REST = (Phase.UNFINISHED, Phase.COMPLETE)
_Ways = Mapping[Phase, tuple[Phase, ...]]


def _stay(*phases: Phase) -> _Ways:
    return {phase: (phase,) for phase in phases}


def _lead(to: Phase, *phases: Phase) -> _Ways:
    return dict.fromkeys(phases, (to,))


_WAYS: Mapping[Event, _Ways] = {
    Event.STARTED: _lead(Phase.PREFLIGHT, Phase.PLANNED),
    Event.RESUMED: _lead(Phase.PREFLIGHT, *RESUMABLE, Phase.CLOSED),
    Event.REDO: _lead(Phase.PREFLIGHT, *RESUMABLE, Phase.CLOSED, Phase.COMPLETE),
    Event.ACTIVATED: _lead(Phase.READY, Phase.PREFLIGHT),
    Event.TARED: _stay(Phase.READY),
    Event.PAUSED: _lead(Phase.PAUSED, Phase.READY),
    Event.CONTINUED: _lead(Phase.READY, Phase.PAUSED),
    Event.SET_ASIDE: _stay(Phase.READY),
    Event.TRIAL_STARTED: _lead(Phase.RECORDING, Phase.READY),
    Event.TRIAL_RECORDED: _lead(Phase.REVIEW, Phase.RECORDING),
    Event.TRIAL_KEPT: _lead(Phase.READY, Phase.REVIEW),
    Event.TRIAL_REJECTED: {
        **_lead(Phase.READY, Phase.RECORDING, Phase.REVIEW),
        **_stay(Phase.CRASHED),
    },
    Event.VERDICT: {
        Phase.UNFINISHED: _AT_REST,
        Phase.COMPLETE: _AT_REST,
        Phase.CLOSED: (Phase.CLOSED, Phase.COMPLETE),
        Phase.CRASHED: (Phase.CRASHED,),
    },
    Event.NOTED: _stay(*(phase for phase in Phase if phase is not Phase.PLANNED)),
    Event.ENDED: {
        **dict.fromkeys(
            (Phase.PREFLIGHT, Phase.READY, Phase.PAUSED, Phase.CRASHED), _AT_REST
        ),
        # A trial that was left without a verdict is what a crash leaves.
        **_lead(Phase.CRASHED, Phase.RECORDING, Phase.REVIEW),
    },
    Event.GIVEN_UP: _lead(Phase.CLOSED, *RESUMABLE),
    Event.CRASH_FOUND: _lead(Phase.CRASHED, *OPEN),
}

_WHY: Mapping[Phase, str] = {
    Phase.PLANNED: "the session has not been started",
    Phase.PREFLIGHT: "the arm is not active yet",
    Phase.READY: "no trial is running",
    Phase.RECORDING: "a trial is being recorded",
    Phase.REVIEW: "a trial waits for its verdict",
    Phase.PAUSED: "the session is paused",
    Phase.UNFINISHED: "the session is not open: traction resume",
    Phase.COMPLETE: "the session is complete",
    Phase.CLOSED: "the session was closed",
    Phase.CRASHED: "the session ended without closing: traction resume",
}
_OPENING = frozenset({Event.STARTED, Event.RESUMED, Event.REDO, Event.GIVEN_UP})


def _step(phase: Phase, event: Event) -> Step:
    to = _WAYS[event].get(phase, ())
    if to:
        return Step(to)
    if event is Event.STARTED and phase is not Phase.PLANNED:
        return Step(refused="the session was started before")
    if phase in OPEN and event in _OPENING | {Event.VERDICT}:
        return Step(refused="the session is open")
    return Step(refused=_WHY[phase])


TABLE: Mapping[tuple[Phase, Event], Step] = {
    (phase, event): _step(phase, event) for phase in Phase for event in Event
}


def table_lines() -> list[str]:
    """Return the table for people: one line per pair, phase by phase."""
    lines: list[str] = []
    for (phase, event), step in TABLE.items():
        result = f"refused: {step.refused}"
        if step.to:
            result = "-> " + " or ".join(step.to)
        lines.append(f"{phase:<11} {event:<16} {result}")
    return lines
