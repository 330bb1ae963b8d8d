"""Sessions of a report, an export or a publication."""

from collections.abc import Sequence
from pathlib import Path

from acquisition.errors import SessionError
from experiments.messages import CATALOGUE
from experiments.operator.console import WARNING, Console
from experiments.session.kept_files import check_kept, journal_deviations
from experiments.session.reducer import replay
from experiments.session.store import SessionFolder, find_session, list_sessions


def choose_sessions(
    data: Path, names: Sequence[str], *, every: bool
) -> list[SessionFolder]:
    """Return the sessions to report, of one kind only.

    Raises:
        SessionError: none are named or found, or live and simulated ones are mixed.
    """
    if bool(names) == every:
        raise SessionError(
            "Name sessions, e.g. S012, or all of them (report, publish): --all.",
            hint="Nothing was read.",
        )
    if every:
        sessions = [s for s in list_sessions(data) if _counts(s)]
    else:
        sessions = [find_session(data, name) for name in dict.fromkeys(names)]
    if not sessions:
        hint = "Record some: traction run S0 --fake --fast"
        raise SessionError(f"There are no kept trials in {data}.", hint=hint)
    simulated = [s for s in sessions if s.is_simulated]
    if simulated and len(simulated) < len(sessions):
        message, values = CATALOGUE["mixed"], {"session": simulated[0].id}
        what, hint = (t.format_map(values) for t in (message.what, message.do))
        raise SessionError(what, hint=hint)
    return sessions


def _counts(session: SessionFolder) -> bool:
    """Whether a session has kept trials, or had some before its journal was damaged."""
    return bool(replay(session.events()).kept or journal_deviations(session))


def report_missing(
    sessions: Sequence[SessionFolder], console: Console, *, allow_missing: bool
) -> list[str]:
    """Print and return messages on missing or changed kept trials.

    Raises:
        KeptDataError: there are such trials, and `allow_missing` is false.
    """
    deviations = check_kept(sessions, allow_missing=allow_missing)
    texts = [f"Not as in the journal: {deviation.text()}." for deviation in deviations]
    for text in texts:
        console.problem(f"{WARNING} {text}")
    return texts


def folder_of(sessions: Sequence[SessionFolder], data: Path, out: Path | None) -> Path:
    """Return the folder of a report: `out`, a session's own, or that of the study."""
    own = sessions[0].path if len(sessions) == 1 else data / "study"
    return out or own
