"""A session as a pure reducer over its journal."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any


@dataclass(frozen=True, slots=True)
class SessionState:
    """What the journal says of a session.

    Attributes:
        terrain: name of the terrain.
        wanted: how many kept trials make it complete.
        kept: numbers of the kept trials, in order.
        rejected: how many trials were rejected or interrupted.
        attempts: how many attempts each number has had so far.
        running: number of the trial being recorded, None between trials.
        ended: why it ended: "complete", "unfinished", "fault"; empty while open.
    """

    terrain: str = ""
    wanted: int = 0
    kept: tuple[int, ...] = ()
    rejected: int = 0
    attempts: tuple[tuple[int, int], ...] = ()
    running: int | None = None
    ended: str = ""

    @property
    def is_complete(self) -> bool:
        """Whether every wanted trial was kept."""
        return len(self.kept) >= self.wanted > 0

    @property
    def next_trial(self) -> int:
        """Smallest trial number that has not been kept."""
        number = 1
        while number in self.kept:
            number += 1
        return number

    def attempt(self, number: int) -> int:
        """Return how many attempts trial `number` has had, 0 before the first."""
        return dict(self.attempts).get(number, 0)


def apply(state: SessionState, event: Mapping[str, Any]) -> SessionState:
    """Return the state after `event`; unknown or impossible events change nothing."""
    handler = _HANDLERS.get(str(event.get("event")))
    if state.ended or handler is None:
        return state
    return handler(state, event)


def _start(state: SessionState, event: Mapping[str, Any]) -> SessionState:
    if state.terrain:
        return state
    terrain, wanted = str(event.get("terrain", "")), _whole(event, "trials")
    return replace(state, terrain=terrain, wanted=wanted) if wanted else state


def _end(state: SessionState, event: Mapping[str, Any]) -> SessionState:
    if not state.terrain:
        return state
    reason = str(event.get("reason") or "unfinished")
    return replace(state, ended=reason, running=None)


def _whole(event: Mapping[str, Any], key: str) -> int:
    """Return the whole number at `key`, 0 where there is none above 0."""
    value = event.get(key)
    return value if type(value) is int and value > 0 else 0


def _start_trial(state: SessionState, event: Mapping[str, Any]) -> SessionState:
    number = _whole(event, "trial")
    if not (state.terrain and number) or state.running is not None:
        return state
    if number in state.kept:
        return state
    attempts = dict(state.attempts)
    attempts[number] = attempts.get(number, 0) + 1
    return replace(state, running=number, attempts=tuple(sorted(attempts.items())))


def _keep(state: SessionState, event: Mapping[str, Any]) -> SessionState:
    number = _whole(event, "trial")
    if state.running != number:
        return state
    return replace(state, running=None, kept=(*state.kept, number))


def _reject(state: SessionState, event: Mapping[str, Any]) -> SessionState:
    if state.running != _whole(event, "trial"):
        return state
    return replace(state, running=None, rejected=state.rejected + 1)


_HANDLERS = {
    "session-started": _start,
    "session-ended": _end,
    "trial-started": _start_trial,
    "trial-kept": _keep,
    "trial-rejected": _reject,
}


def replay(events: Iterable[Mapping[str, Any]]) -> SessionState:
    """Return the state after all `events`."""
    state = SessionState()
    for event in events:
        state = apply(state, event)
    return state
