"""A session as a pure reducer over its journal."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from math import isfinite
from typing import Any, cast

from experiments.session.sidecar import (
    KEEP,
    REJECT,
    Attempt,
    TrialName,
    Verdict,
    checksum_and_size,
)
from experiments.session.states import TABLE, Event, PhaseChange, SessionPhase

_EVENTS = {str(event): event for event in Event}
_AXES = 6  # of a wrench
_Facts = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class SessionState:
    """State of a session after the events of its journal.

    Attributes:
        phase: phase of the session.
        terrain: name of the terrain.
        operator: operator of the last opening.
        wanted: number of kept trials that completes it.
        kept_attempts: (number, attempt) of the kept trials, in the order of keeping.
        attempts: every attempt so far, in the order of their names.
        untared: newest attempt of this opening, until a tare follows it.
        running: number of the trial without a verdict, None between trials.
        redoing: number of the trial to repeat, or None.
        is_redo: whether it was opened only to repeat one trial.
        openings: number of openings.
        ended: reason of the end: "complete", "unfinished", a fault; empty while open.
        tares: number of tares since it was opened.
        first_bias, last_bias: sensor reading less the foot's weight at the first and
            the last of these tares [N, N m]; empty before.
    """

    phase: SessionPhase = SessionPhase.PLANNED
    terrain: str = ""
    operator: str = ""
    wanted: int = 0
    kept_attempts: tuple[tuple[int, int], ...] = ()
    attempts: tuple[Attempt, ...] = ()
    untared: TrialName | None = None
    running: int | None = None
    redoing: int | None = None
    is_redo: bool = False
    openings: int = 0
    ended: str = ""
    tares: int = 0
    first_bias: tuple[float, ...] = ()
    last_bias: tuple[float, ...] = ()

    @property
    def drift(self) -> tuple[float, ...]:
        """Drift of the force between first and last tare [N], three numbers.

        Empty with fewer than two tares. It bounds the uncertainty of the force.
        """
        if self.tares < 2:
            return ()
        pairs = zip(self.first_bias[:3], self.last_bias[:3], strict=True)
        return tuple(round(last - first, 3) for first, last in pairs)

    @property
    def kept(self) -> tuple[int, ...]:
        """Numbers of the kept trials, in the order of keeping."""
        return tuple(number for number, _ in self.kept_attempts)

    @property
    def kept_trials(self) -> list[Attempt]:
        """The kept attempts, in the order of their numbers."""
        names = {TrialName(*pair) for pair in self.kept_attempts}
        return [attempt for attempt in self.attempts if attempt.name in names]

    @property
    def rejected(self) -> int:
        """Number of rejected or interrupted attempts."""
        return sum(attempt.is_rejected for attempt in self.attempts)

    @property
    def is_complete(self) -> bool:
        """Whether every wanted trial was kept."""
        return len(self.kept_attempts) >= self.wanted > 0

    @property
    def is_over(self) -> bool:
        """Whether nothing is left to record in this opening."""
        return self.redoing is None if self.is_redo else self.is_complete

    @property
    def next_trial(self) -> int:
        """Trial to repeat, else the smallest number not kept yet."""
        if self.redoing is not None:
            return self.redoing
        number = 1
        while number in self.kept:
            number += 1
        return number

    def attempt(self, number: int) -> int:
        """Number of attempts at trial `number`, 0 before the first."""
        own = (a.name.attempt for a in self.attempts if a.name.number == number)
        return max(own, default=0)

    def kept_attempt(self, number: int) -> int:
        """The kept attempt at trial `number`, 0 if none is kept."""
        return dict(self.kept_attempts).get(number, 0)

    def attempt_at(self, name: TrialName) -> Attempt:
        """Return an attempt by name, an empty one if the journal has none."""
        matches = (attempt for attempt in self.attempts if attempt.name == name)
        return next(matches, Attempt(name))

    def with_attempt(self, changed: Attempt) -> "SessionState":
        """Return the state with `changed` replacing the attempt of that name."""
        others = [a for a in self.attempts if a.name != changed.name]
        attempts = sorted(
            [*others, changed], key=lambda a: (a.name.number, a.name.attempt)
        )
        return replace(self, attempts=tuple(attempts))


def refusal(state: SessionState, event: _Facts) -> str:
    """Return why `event` is not allowed now; empty if it is."""
    name = _EVENTS.get(str(event.get("event")))
    if name is None:
        return "this is not an event of a session"
    refused = TABLE[state.phase, name].refused
    check = _CHECKS.get(name)
    return refused or (check(state, event) if check else "")


def apply(state: SessionState, event: _Facts) -> SessionState:
    """Return the state after `event`; unknown or impossible events change nothing."""
    if refusal(state, event):
        return state
    name = Event(str(event["event"]))
    change = _CHANGES.get(name)
    changed = change(state, event) if change else state
    return replace(changed, phase=_next_phase(TABLE[state.phase, name], changed))


def replay(events: Iterable[_Facts]) -> SessionState:
    """Return the state after all `events`."""
    state = SessionState()
    for event in events:
        state = apply(state, event)
    return state


def _next_phase(step: PhaseChange, state: SessionState) -> SessionPhase:
    """Return the next phase; of two, the kept trials decide."""
    if len(step.to) == 1:
        return step.to[0]
    (other,) = (phase for phase in step.to if phase is not SessionPhase.COMPLETE)
    return SessionPhase.COMPLETE if state.is_complete else other


def _positive_int(event: _Facts, key: str) -> int:
    """Return the positive integer at `key`, else 0."""
    value = event.get(key)
    return value if type(value) is int and value > 0 else 0


def _numbers(value: object) -> tuple[float, ...]:
    """Return a list of finite floats as a tuple; empty for anything else."""
    entries = cast("list[object]", value) if isinstance(value, list) else []
    numbers = tuple(x for x in entries if type(x) is float and isfinite(x))
    return numbers if len(numbers) == len(entries) else ()


# Checks that need more than the phase.
def _check_start(state: SessionState, event: _Facts) -> str:
    del state
    is_whole = bool(event.get("terrain")) and _positive_int(event, "trials")
    return "" if is_whole else "it names no terrain and number of trials"


def _check_redo(state: SessionState, event: _Facts) -> str:
    number = _positive_int(event, "trial")
    if state.running is not None:
        return _check_no_running(state, event)
    return "" if state.attempt(number) else f"T{number:02d} was never recorded"


def _check_new_trial(state: SessionState, event: _Facts) -> str:
    number = _positive_int(event, "trial")
    if number in state.kept:
        return f"T{number:02d} is kept"
    is_wanted = number and state.redoing in (None, number)
    return "" if is_wanted else f"T{number:02d} is not the trial to be recorded"


def _check_running(state: SessionState, event: _Facts) -> str:
    number = _positive_int(event, "trial")
    is_it = number and number == state.running
    return "" if is_it else f"T{number:02d} is not running"


def _check_set_aside(state: SessionState, event: _Facts) -> str:
    number = _positive_int(event, "trial")
    is_it = number == state.redoing and number in state.kept
    return "" if is_it else f"T{number:02d} is not a kept trial to be repeated"


def _check_verdict(state: SessionState, event: _Facts) -> str:
    number, attempt = _positive_int(event, "trial"), _positive_int(event, "attempt")
    if not 1 <= attempt <= state.attempt(number):
        return "there is no such attempt"
    if number == state.running and attempt == state.attempt(number):
        return _check_no_running(state, event)
    if event.get("verdict") not in (KEEP, REJECT):
        return "a verdict is keep or reject"
    kept = state.kept_attempt(number)
    if event.get("verdict") == KEEP and kept not in (0, attempt):
        return f"another attempt at T{number:02d} is kept"
    return ""


def _check_no_running(state: SessionState, event: _Facts) -> str:
    """Refuse while a trial cut off by a crash has no verdict."""
    del event
    if state.running is None or state.phase is not SessionPhase.CRASHED:
        return ""
    return f"T{state.running:02d} has no verdict yet"


_CHECKS: Mapping[Event, Callable[[SessionState, _Facts], str]] = {
    Event.STARTED: _check_start,
    Event.RESUMED: _check_no_running,
    Event.REDO: _check_redo,
    Event.SET_ASIDE: _check_set_aside,
    Event.TRIAL_STARTED: _check_new_trial,
    Event.TRIAL_RECORDED: _check_running,
    Event.TRIAL_KEPT: _check_running,
    Event.TRIAL_REJECTED: _check_running,
    Event.VERDICT: _check_verdict,
    Event.ENDED: _check_no_running,
    Event.GIVEN_UP: _check_no_running,
}


# Changes other than the phase.
def _start(state: SessionState, event: _Facts) -> SessionState:
    terrain, wanted = str(event["terrain"]), _positive_int(event, "trials")
    return _open(replace(state, terrain=terrain, wanted=wanted), event)


def _open(state: SessionState, event: _Facts) -> SessionState:
    operator = str(event.get("operator") or state.operator)
    openings = state.openings + 1
    state = replace(state, openings=openings, ended="", redoing=None, is_redo=False)
    state = replace(state, operator=operator, untared=None)
    return replace(state, tares=0, first_bias=(), last_bias=())


def _redo(state: SessionState, event: _Facts) -> SessionState:
    number = _positive_int(event, "trial")
    return replace(_open(state, event), redoing=number, is_redo=True)


def _end(state: SessionState, event: _Facts) -> SessionState:
    reason = str(event.get("reason") or "unfinished")
    return replace(state, ended=reason, redoing=None, is_redo=False)


def _tare(state: SessionState, event: _Facts) -> SessionState:
    bias = _numbers(event.get("bias"))
    if len(bias) != _AXES:
        return state
    t_ns = _positive_int(event, "t_ns")
    if state.untared is not None and t_ns:
        before = state.attempt_at(state.untared)
        tare = {"t_ns": t_ns, "bias": list(bias)}
        state = state.with_attempt(replace(before, next_tare=tare))
    state = replace(state, untared=None, tares=state.tares + 1, last_bias=bias)
    return replace(state, first_bias=state.first_bias or bias)


def _start_trial(state: SessionState, event: _Facts) -> SessionState:
    number = _positive_int(event, "trial")
    name = TrialName(number, state.attempt(number) + 1)
    return replace(state.with_attempt(Attempt(name)), running=number)


def _record(state: SessionState, event: _Facts) -> SessionState:
    recorded = replace(_running(state), is_recorded=True)
    state = state.with_attempt(_with_recording(recorded, event))
    return replace(state, untared=recorded.name)


def _keep(state: SessionState, event: _Facts) -> SessionState:
    attempt = _running(state)
    # The line that started an attempt may be lost: this one states its number.
    newest = max(attempt.name.attempt, _positive_int(event, "attempt"))
    others = tuple(other for other in state.attempts if other != attempt)
    kept = replace(attempt, name=TrialName(attempt.name.number, newest))
    redoing = None if state.redoing == kept.name.number else state.redoing
    state = replace(state, attempts=others, running=None, redoing=redoing)
    return _judge(state, kept, KEEP, event)


def _reject(state: SessionState, event: _Facts) -> SessionState:
    rejected = _with_recording(_running(state), event)
    return _judge(replace(state, running=None), rejected, REJECT, event)


def _set_aside(state: SessionState, event: _Facts) -> SessionState:
    number = _positive_int(event, "trial")
    name = TrialName(number, state.kept_attempt(number))
    return _judge(state, state.attempt_at(name), REJECT, event)


def _change_verdict(state: SessionState, event: _Facts) -> SessionState:
    number, attempt = _positive_int(event, "trial"), _positive_int(event, "attempt")
    is_kept = state.kept_attempt(number) == attempt
    is_changed = is_kept != (event.get("verdict") == KEEP)
    if is_changed and state.is_redo and state.phase is SessionPhase.READY:
        state = replace(state, redoing=number if is_kept else None)
    judged = state.attempt_at(TrialName(number, attempt))
    return _judge(state, judged, str(event["verdict"]), event)


def _note(state: SessionState, event: _Facts) -> SessionState:
    name = TrialName(_positive_int(event, "trial"), _positive_int(event, "attempt"))
    if not 1 <= name.attempt <= state.attempt(name.number):
        return state  # of the session
    attempt = state.attempt_at(name)
    note = {"text": _text(event, "text"), "who": _text(event, "who")}
    notes = (*attempt.notes, {**note, "when": _text(event, "utc")})
    return state.with_attempt(replace(attempt, notes=notes))


def _judge(
    state: SessionState, attempt: Attempt, verdict: str, event: _Facts
) -> SessionState:
    """Return the state after a verdict on an attempt."""
    texts = (_text(event, key) for key in ("reason", "who", "utc"))
    attempt = attempt.with_verdict(Verdict(verdict, *texts))
    pair = (attempt.name.number, attempt.name.attempt)
    kept = state.kept_attempts
    if verdict != KEEP:
        kept = tuple(other for other in kept if other != pair)
    else:
        attempt = replace(attempt, sums={**attempt.sums, **checksum_and_size(event)})
        kept = kept if pair in kept else (*kept, pair)
    return replace(state.with_attempt(attempt), kept_attempts=kept)


def _running(state: SessionState) -> Attempt:
    number = state.running or 0
    return state.attempt_at(TrialName(number, state.attempt(number)))


def _with_recording(attempt: Attempt, event: _Facts) -> Attempt:
    """Return the attempt with the recording's figures from `event`."""
    recording = event.get("recording")
    if not isinstance(recording, Mapping):
        return attempt
    return replace(attempt, recording=cast("Mapping[str, object]", recording))


def _text(event: _Facts, key: str) -> str:
    return str(event.get(key) or "")


_CHANGES: Mapping[Event, Callable[[SessionState, _Facts], SessionState]] = {
    Event.STARTED: _start,
    Event.RESUMED: _open,
    Event.REDO: _redo,
    Event.TARED: _tare,
    Event.SET_ASIDE: _set_aside,
    Event.TRIAL_STARTED: _start_trial,
    Event.TRIAL_RECORDED: _record,
    Event.TRIAL_KEPT: _keep,
    Event.TRIAL_REJECTED: _reject,
    Event.VERDICT: _change_verdict,
    Event.NOTED: _note,
    Event.ENDED: _end,
    Event.GIVEN_UP: _end,
}
