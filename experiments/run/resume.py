"""Sessions that are on the disk, opened once more: resumed, redone, or closed."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from acquisition.clock import SystemClock
from acquisition.errors import SessionError, SettingsError
from experiments.arguments import PACES
from experiments.messages import CATALOGUE
from experiments.operator.console import Console
from experiments.operator.select import choose_keys
from experiments.rig.rig import FakeOptions
from experiments.run.session import OpenMode, SessionRequest, run_session
from experiments.session.crash_recovery import recover_session
from experiments.session.journal import Journal, open_journal
from experiments.session.lock import session_lock
from experiments.session.reducer import refusal
from experiments.session.states import Event, SessionPhase
from experiments.session.store import SessionFolder
from experiments.settings.load import load_settings

_FAKE = TypeAdapter(FakeOptions)
_OPENINGS = (Event.STARTED, Event.RESUMED, Event.REDO)


@dataclass(frozen=True, slots=True)
class ResumeRequest:
    """What the command line says about a session to be opened once more.

    Attributes:
        data: the data folder.
        config: a rig.toml; None = the one of the session.
        console: where it is said.
        is_fast: on stepped time, whatever it was before.
        is_fake: a simulated session is meant.
        is_forced: other conditions are no obstacle.
        operator: name of the person; empty = the one of the session.
        script: who answers the reviews; None = whoever is there.
        can_log: where the bus is written to.
        faults: to be raised in the simulation, as on the command line.
    """

    data: Path
    config: Path | None
    console: Console
    is_fast: bool = False
    is_fake: bool = False
    is_forced: bool = False
    operator: str = ""
    script: str | None = None
    can_log: Path | None = None
    faults: tuple[str, ...] = ()


def resume(folder: SessionFolder, how: ResumeRequest) -> int:
    """Continue a session that is not finished; return the exit code.

    Raises:
        SessionError: it is open elsewhere, not to be resumed, or of the other kind.
    """
    _check_kind(folder, how)
    with session_lock(folder):
        journal = _settled(folder, how.console)
        if journal.state.phase is SessionPhase.CRASHED and journal.state.is_complete:
            journal.note(Event.ENDED, reason="complete")
            how.console.say(CATALOGUE["complete"].text({"session": folder.id}))
            return 0
        return _reopen(journal, how, Event.RESUMED, {})


def redo(folder: SessionFolder, number: int, reason: str, how: ResumeRequest) -> int:
    """Record trial `number` once more; return the exit code.

    Raises:
        SessionError: it is open elsewhere, has no such trial, or is of the other kind.
    """
    _check_kind(folder, how)
    with session_lock(folder):
        journal = _settled(folder, how.console)
        return _reopen(journal, how, Event.REDO, {"trial": number, "reason": reason})


def close(folder: SessionFolder, reason: str, console: Console) -> None:
    """Give an unfinished session up; what was kept stays.

    Raises:
        SessionError: it is open elsewhere.
    """
    with session_lock(folder):
        journal = _settled(folder, console)
        if journal.state.is_complete:
            journal.note(Event.ENDED, reason="complete")
        else:
            journal.note(Event.GIVEN_UP, reason=reason)
    console.say(f"{folder.id} is closed with {len(journal.state.kept)} kept trials.")


def _settled(folder: SessionFolder, console: Console) -> Journal:
    journal = open_journal(folder, SystemClock())
    said = recover_session(journal)
    if said:
        facts = {"session": folder.id, "redone": f" {said}"}
        console.say(CATALOGUE["put-away"].text(facts))
    return journal


def _check_kind(folder: SessionFolder, how: ResumeRequest) -> None:
    if folder.is_simulated:
        return
    if how.is_fake:
        raise SessionError(
            f"{folder.id} is a session with the real arm.",
            hint="Leave --fake out. Simulated and real trials do not mix.",
        )
    if how.is_fast or how.script or how.faults:
        raise SettingsError(
            "--fast, --fault and --operator-script work only with a simulated session.",
            hint="Nothing was started.",
        )


def _reopen(
    journal: Journal, how: ResumeRequest, event: Event, asked: Mapping[str, object]
) -> int:
    folder, console = journal.folder, how.console
    reason = refusal(journal.state, {"event": event, **asked})
    if reason:
        raise SessionError(
            f"{folder.id} cannot be opened: {reason}.", hint="Nothing was started."
        )
    before = _last_asked(journal)
    config = how.config or _config_of(before)
    settings = load_settings(config)
    fake = _fake_of(before, how) if folder.is_simulated else None
    request = SessionRequest(
        data=how.data,
        settings=settings,
        config=config,
        row=settings.row(folder.terrain),
        fake=fake,
        operator=how.operator or str(before.get("operator") or ""),
        keys=choose_keys(how.script, is_fake=folder.is_simulated),
        console=console,
        faults=how.faults,
        can_log=how.can_log,
    )
    kept = len(journal.state.kept)
    console.say(f"session {folder.id}: {kept} of {journal.state.wanted} kept")
    return run_session(request, OpenMode(event, asked, journal, how.is_forced))


def _last_asked(journal: Journal) -> dict[str, Any]:
    """Return what was asked for when the session was opened last."""
    found: dict[str, Any] = {}
    for event in journal.folder.events():
        if event.get("event") in _OPENINGS:
            found = event
    return found


def _config_of(asked: Mapping[str, Any]) -> Path | None:
    config = asked.get("config")
    return Path(config) if isinstance(config, str) and config else None


def _fake_of(asked: Mapping[str, Any], how: ResumeRequest) -> FakeOptions:
    """Return how it was simulated before, on stepped time if that is asked for."""
    try:
        before = _FAKE.validate_python(asked.get("fake"))
    except ValidationError:
        before = FakeOptions(is_fast=False, seed=1)
    pace = before.pace if before.pace in PACES else PACES[0]
    is_fast = how.is_fast or before.is_fast
    return FakeOptions(is_fast, before.seed, before.friction, pace)
