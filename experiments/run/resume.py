"""Resume, redo or close a session on the disk."""

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from acquisition.clock import SystemClock
from acquisition.errors import SessionError, SettingsError
from acquisition.wording import counted
from experiments.arguments import PACES, TimeMode, requested_time_mode
from experiments.messages import CATALOGUE
from experiments.operator.console import WARNING, Console
from experiments.operator.keys import KeyAction
from experiments.operator.prompts import OperatorInput, Prompt
from experiments.operator.scripted import NO_PERSONS, choose_operator
from experiments.operator.terminal import TerminalInput, wait_for_key
from experiments.rig.rig import FakeOptions
from experiments.run.session import OpenMode, SessionRequest, run_session
from experiments.session.crash_recovery import recover_session
from experiments.session.journal import Journal, open_journal
from experiments.session.kept_files import check_kept
from experiments.session.lock import session_lock
from experiments.session.reducer import refusal
from experiments.session.states import Event, SessionPhase
from experiments.session.store import SessionFolder
from experiments.session.unfinished import UnfinishedSession
from experiments.settings.load import load_settings


class ResumeChoice(Enum):
    """Choice for an unfinished session."""

    RESUME = "resume"
    CLOSE = "close"


_CHOICES = {
    KeyAction.RESUME: ResumeChoice.RESUME,
    KeyAction.CLOSE: ResumeChoice.CLOSE,
}


def choose_resume(
    sessions: Sequence[UnfinishedSession],
    terrain: str,
    data: str,
    operator: OperatorInput,
    console: Console,
) -> ResumeChoice:
    """Ask whether to resume or close the newest unfinished session.

    Args:
        sessions: the unfinished sessions, oldest first, at least one.
        terrain: the requested terrain.
        data: option of a command that names the data folder, "" for none.
        operator: answers the question.
        console: output.

    Raises:
        SessionError: there is no terminal, or the answer was [q]uit.
    """
    newest = sessions[-1]
    text = _question(newest, terrain)
    if not isinstance(operator, TerminalInput):
        raise SessionError(
            " ".join([text, *(other.text() for other in sessions[:-1])]),
            hint=f"To go on: traction resume {newest.folder.id}{data}   To close it: "
            "the same command with --new. Nothing was started.",
        )
    name = "crash" if newest.is_crashed else "unfinished"
    name = "mismatch" if newest.folder.terrain != terrain else name
    details = {**newest.metadata(), "asked": terrain}
    console.say(f"{WARNING} {text} {CATALOGUE[name].do.format_map(details)}  [q]uit")
    action = wait_for_key(operator, Prompt.CHOICE)
    if action is KeyAction.QUIT:
        raise SessionError(text, hint="Nothing was started.")
    return _CHOICES[action]


def _question(newest: UnfinishedSession, terrain: str) -> str:
    """Message on the unfinished session, with the terrains if they differ."""
    if newest.folder.terrain == terrain:
        return newest.text()
    details = {**newest.metadata(), "asked": terrain}
    mismatch = CATALOGUE["mismatch"].what.format_map(details)
    return f"{newest.text()} {mismatch}" if newest.is_crashed else mismatch


_FAKE = TypeAdapter(FakeOptions)
_OPENINGS = (Event.STARTED, Event.RESUMED, Event.REDO)


@dataclass(frozen=True, slots=True)
class ResumeRequest:
    """Request to open a session again, from the command line.

    Attributes:
        data: the data folder.
        config: a rig.toml; None = that of the session.
        console: output.
        mode: mode of simulated time; None = as before.
        is_fake: whether a simulated session is expected.
        is_forced: record under other conditions, too.
        allow_missing: continue without kept trials that are missing or changed.
        operator: name; empty = that of the session.
        script: script of an operator; None = the keyboard.
        can_log: log file of the bus.
        faults: faults to inject into the simulation.
    """

    data: Path
    config: Path | None
    console: Console
    mode: TimeMode | None = None
    is_fake: bool = False
    is_forced: bool = False
    allow_missing: bool = False
    operator: str = ""
    script: str | None = None
    can_log: Path | None = None
    faults: tuple[str, ...] = ()


def resume_request(args: argparse.Namespace) -> ResumeRequest:
    """Build the request from the options of `resume` and `redo`."""
    return ResumeRequest(
        data=args.data,
        config=args.config,
        console=Console(color=not args.no_color, goes_on=True),
        mode=requested_time_mode(args),
        is_fake=args.fake,
        is_forced=args.force,
        allow_missing=args.allow_missing,
        operator=args.operator,
        script=args.operator_script,
        can_log=args.can_log,
        faults=tuple(args.fault),
    )


def resume_session(folder: SessionFolder, request: ResumeRequest) -> int:
    """Resume an unfinished session; returns the exit code.

    Raises:
        SessionError: the session is open elsewhere, cannot be resumed, or is of the
            other kind.
    """
    _check_kind(folder, request)
    with session_lock(folder):
        _check_kept(folder, request)
        journal = _recovered(folder, request.console)
        if journal.state.phase is SessionPhase.CRASHED and journal.state.is_complete:
            journal.append(Event.ENDED, reason="complete")
            request.console.say(CATALOGUE["complete"].text({"session": folder.id}))
            return 0
        return _reopen(journal, request, Event.RESUMED, {})


def redo(
    folder: SessionFolder, number: int, reason: str, request: ResumeRequest
) -> int:
    """Repeat trial `number`; returns the exit code.

    Raises:
        SessionError: the session is open elsewhere, has no such trial, or is of the
            other kind.
    """
    _check_kind(folder, request)
    with session_lock(folder):
        _check_kept(folder, request)
        journal = _recovered(folder, request.console)
        return _reopen(
            journal, request, Event.REDO, {"trial": number, "reason": reason}
        )


def close(folder: SessionFolder, reason: str, console: Console) -> None:
    """Close an unfinished session; its kept trials stay.

    Raises:
        SessionError: the session is open elsewhere.
    """
    with session_lock(folder):
        journal = _recovered(folder, console)
        if journal.state.is_complete:
            journal.append(Event.ENDED, reason="complete")
        else:
            journal.append(Event.GIVEN_UP, reason=reason)
    console.say(
        f"{folder.id} is closed with {counted(len(journal.state.kept), 'kept trial')}."
    )


def _recovered(folder: SessionFolder, console: Console) -> Journal:
    journal = open_journal(folder, SystemClock())
    redone = recover_session(journal)
    if redone:
        details = {"session": folder.id, "redone": f" {redone}"}
        console.say(CATALOGUE["put-away"].text(details))
    return journal


def _check_kept(folder: SessionFolder, request: ResumeRequest) -> None:
    """Refuse to go on with kept trials missing, unless that is allowed.

    Checked before the files are derived again, since they are the only evidence of
    events that the journal has lost.

    Raises:
        KeptDataError: kept trials are missing or changed.
    """
    for deviation in check_kept([folder], allow_missing=request.allow_missing):
        request.console.problem(f"{WARNING} {deviation.text()}.")


def _check_kind(folder: SessionFolder, request: ResumeRequest) -> None:
    if folder.is_simulated:
        return
    if request.is_fake:
        raise SessionError(
            f"{folder.id} is a session with the real arm.",
            hint="Leave --fake out. Simulated and real trials do not mix.",
        )
    if request.mode or request.script or request.faults:
        raise SettingsError(
            "--fast, --processes, --fault and --operator-script work only with a "
            "simulated session.",
            hint="Nothing was started.",
        )


def _reopen(
    journal: Journal,
    request: ResumeRequest,
    event: Event,
    details: Mapping[str, object],
) -> int:
    folder, console = journal.folder, request.console
    if reason := refusal(journal.state, {"event": event, **details}):
        why = f"{folder.id} cannot be opened: {reason}."
        raise SessionError(why, hint="Nothing was started.")
    before = _last_opening(journal)
    settings = load_settings(config := request.config or _path_of(before, "config"))
    fake = fake_of(before, request) if folder.is_simulated else None
    operator = choose_operator(request.script, is_fake=folder.is_simulated)
    session = SessionRequest(
        data=request.data,
        settings=settings,
        config=config,
        row=settings.row(folder.terrain),
        fake=fake,
        operator_name=request.operator or _person_of(before, operator),
        operator=operator,
        console=console,
        faults=request.faults,
        can_log=request.can_log,
    )
    state = journal.state
    console.say(f"session {folder.id}: {len(state.kept)} of {state.wanted} kept")
    return run_session(session, OpenMode(event, details, journal, request.is_forced))


def _last_opening(journal: Journal) -> dict[str, Any]:
    """Event of the last opening of the session."""
    events = [e for e in journal.folder.events() if e.get("event") in _OPENINGS]
    return events[-1] if events else {}


def _person_of(opening: Mapping[str, Any], operator: OperatorInput) -> str:
    """Return the session's operator; "" if that or the present one is no person."""
    name = str(opening.get("operator") or "")
    return "" if NO_PERSONS & {name, operator.who} else name


def _path_of(opening: Mapping[str, Any], name: str) -> Path | None:
    written = opening.get(name) or None
    return Path(written) if isinstance(written, str) else None


def fake_of(opening: Mapping[str, Any], request: ResumeRequest) -> FakeOptions:
    """Return the options of the last simulation, with the requested time mode."""
    try:
        before = _FAKE.validate_python(opening.get("fake"))
    except ValidationError:
        before = FakeOptions("paced", seed=1)
    pace = before.pace if before.pace in PACES else PACES[0]
    return replace(before, mode=request.mode or before.mode, pace=pace)
