"""From sessions of stances to their page."""

from collections.abc import Sequence
from pathlib import Path

from acquisition import SessionError, SystemClock
from analysis.report import ReportContext, StanceGroup, stance_html
from experiments.session import (
    SessionFolder,
    find_session,
    iso_utc,
    read_stance_task,
    stance_outcomes,
    write_text,
)

_PAGE = "index.html"


def stance_sessions(data: Path, names: Sequence[str]) -> list[SessionFolder]:
    """Return the named sessions if they are of stances, none if they are of pushes.

    Raises:
        SessionError: there is no such session, or both kinds are named.
    """
    sessions = [find_session(data, name) for name in dict.fromkeys(names)]
    standing = [session for session in sessions if session.is_of_stances]
    if standing and len(standing) < len(sessions):
        raise SessionError(
            f"{standing[0].id} is of stances, others are of pushes.",
            hint="Report them apart. Nothing was written.",
        )
    return standing


def report_stances(sessions: Sequence[SessionFolder], data: Path) -> Path:
    """Write the page of sessions of stances; return it.

    One session is reported into its own folder, several into `data`/stances.

    Raises:
        SessionError: no session has a kept stance, or a file is not what it was.
    """
    groups: list[StanceGroup] = []
    for session in sessions:
        task = read_stance_task(session)
        outcomes = [one for _, of in stance_outcomes(session) for one in of]
        if task is not None and outcomes:
            groups.append(
                StanceGroup(session.terrain, task.name, task.request, outcomes)
            )
    if not groups:
        raise SessionError(f"{', '.join(s.id for s in sessions)}: no kept stances.")
    count = sum(len(group.outcomes) for group in groups)
    terrains = dict.fromkeys(group.terrain for group in groups)
    context = ReportContext(
        title="Traction " + (sessions[0].id if len(sessions) == 1 else "stances"),
        subtitle=f"{count} stances on {', '.join(terrains)}",
        is_simulated=sessions[0].is_simulated,
        is_foreign=False,
        generated_utc=iso_utc(SystemClock().utc_ns()),
    )
    own = sessions[0].path / "report" if len(sessions) == 1 else data / "stances"
    own.mkdir(parents=True, exist_ok=True)
    write_text(own / _PAGE, stance_html(context, groups))
    return own / _PAGE
