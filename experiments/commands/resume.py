"""traction resume: continue an unfinished session."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from experiments.arguments import add_reopening_options

if TYPE_CHECKING:
    from experiments.session.store import SessionFolder

EXAMPLES = """\
  traction resume                           the only unfinished session
  traction resume S012 --operator mk        one of several, by another person"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `resume`."""
    parser.add_argument(
        "session", nargs="?", metavar="SESSION", help="S012 or a folder (the only one)"
    )
    add_reopening_options(parser)


def run(args: argparse.Namespace) -> int:
    """Record the missing trials; returns the exit code."""
    from experiments.run.resume import resume_request, resume_session
    from experiments.session.store import find_session

    if args.session is None:
        folder = _only_one(args.data, is_fake=args.fake)
    else:
        folder = find_session(args.data, args.session)
    return resume_session(folder, resume_request(args))


def _only_one(data: Path, *, is_fake: bool) -> "SessionFolder":
    """Return the only unfinished session below `data`.

    Raises:
        SessionError: there is none, or several, or it is open elsewhere.
    """
    from acquisition.errors import SessionError
    from experiments.session.lock import locked_error, owner_of
    from experiments.session.store import list_sessions
    from experiments.session.unfinished import find_unfinished

    sessions = [
        session
        for session in find_unfinished(data)
        if session.folder.is_simulated or not is_fake
    ]
    if not sessions:
        for folder in list_sessions(data):
            is_meant = folder.is_simulated or not is_fake
            if is_meant and owner_of(folder) is not None:
                raise locked_error(folder)
        raise SessionError(
            f"There is no unfinished session in {data / 'sessions'}.",
            hint="Start one: traction run TERRAIN",
        )
    if len(sessions) > 1:
        raise SessionError(
            f"{len(sessions)} sessions are unfinished: "
            + " ".join(session.text() for session in sessions),
            hint=f"Name one, e.g. traction resume {sessions[-1].folder.id}",
        )
    return sessions[0].folder
