"""Inspects what the program recovers from a disk after a power cut."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from acquisition.clock import SystemClock
from experiments.session.crash_recovery import recover_session
from experiments.session.data_files import parse_line
from experiments.session.journal import open_journal
from experiments.session.lock import session_lock
from experiments.session.reducer import replay
from experiments.session.store import JOURNAL_FILE, SessionFolder, list_sessions
from experiments.session.unfinished import find_unfinished
from tests.crash.disk import everything
from tests.crash.syscalls import Link, Operation, SyncFile
from tests.experiments.program import Done, digest, traction

CLOCK = SystemClock()
LEFT_BEHIND = ("*.tmp", "*.mcap.partial", ".recover-*")
FLUSHES = 3  # after so many a trial file holds more than its header
Journals = dict[Path, list[dict]]  # events by folder, relative to the data


def acknowledged(operations: Sequence[Operation]) -> Journals:
    """Durable events of each session, by its folder.

    An event is durable once its journal was forced to the disk; the program reports
    the event to the operator only then.
    """
    names = everything(operations).names
    journals = {n: path for path, n in names.items() if path.name == JOURNAL_FILE}
    last = {o.file: i for i, o in enumerate(operations) if isinstance(o, SyncFile)}
    return {
        path.parent: events_in(everything(operations[: last[n]]).contents.get(n, b""))
        for n, path in journals.items()
        if n in last
    }


def recordings(operations: Sequence[Operation]) -> int:
    """Number of trial files with some recording that was forced to the disk."""
    forced = Counter(o.file for o in operations if isinstance(o, SyncFile))
    begun = {
        operation.file
        for operation in operations
        if isinstance(operation, Link) and _is_trial(operation.path)
    }
    return sum(forced[file] >= FLUSHES for file in begun)


def _is_trial(path: Path) -> bool:
    return ".mcap" in path.name and not {"truth", "recovered"} & {*path.name.split(".")}


def events_in(journal: bytes) -> list[dict]:
    """Events of a journal."""
    return [event for event in map(parse_line, journal.splitlines()) if event]


def checksum_and_size(events: Sequence[dict]) -> dict[tuple[int, int], str]:
    """{(trial, attempt): sha256} of all attempts that were ever kept."""
    return {
        (event["trial"], event["attempt"]): event["sha256"]
        for event in events
        if "sha256" in event
    }


def problems(root: Path, wanted: Journals, recorded: int) -> list[str]:
    """Problems of `root`/data, after reading and recovering the sessions.

    Args:
        root: folder with the files after a power cut.
        wanted: events that must not be lost, see `acknowledged`.
        recorded: number of recordings that must exist, see `recordings`.
    """
    wrong, data = [], root / "data"
    commands = [("status",), ("verify", "--all"), ("recover", data), ("status",)]
    for words in commands if data.exists() else commands[:2]:
        options = () if words[0] == "recover" else ("--data", data)
        is_empty = not list_sessions(data)
        wrong += _bug(words[0], traction(*words, *options), is_empty=is_empty)
    find_unfinished(data)
    sessions = {session.path: session for session in list_sessions(data)}
    wrong += [f"{path} is gone" for path in wanted if root / path not in sessions]
    put_in_order(data)
    for path, session in sessions.items():
        wrong += _lost(session, wanted.get(path.relative_to(root), []))
        wrong += [f"{path} is left behind" for path in _left_behind(session)]
    files = [path for path in data.rglob("T*.mcap") if _is_trial(path)]
    wrong += [f"{len(files)} of {recorded} recordings"] * (len(files) < recorded)
    done = traction("verify", "--all", "--data", data)
    is_wrong = bool(done.code) and bool(sessions)
    return wrong + ([f"verify: {done.err}{done.out}"] if is_wrong else [])


def put_in_order(data: Path) -> None:
    """Recover every session below `data`, as its next opening does."""
    for session in list_sessions(data):
        with session_lock(session):
            recover_session(open_journal(session, CLOCK))


def _bug(command: str, done: Done, *, is_empty: bool) -> list[str]:
    """Problem of a command's exit code; without a session 2 is right, too."""
    if done.code in {0, 6} or (is_empty and done.code == 2):
        return []
    return [f"{command} ends with {done.code}: {done.err}"]


def _lost(session: SessionFolder, wanted: Sequence[dict]) -> list[str]:
    """Events and trials that are missing or changed."""
    events = session.events()
    wrong = [] if events[: len(wanted)] == wanted else ["events are lost"]
    counted = {path.stem: digest(path) for path in session.kept_trials()}
    sums = checksum_and_size(events)
    for number, attempt in replay(events).kept_attempts:
        if counted.get(f"T{number:02d}") != sums[number, attempt]:
            wrong.append(f"T{number:02d} of {session.id} does not count")
    files = [*session.trials.glob("*.mcap"), *session.rejected.glob("*.mcap")]
    there = {digest(path) for path in files}
    lost = [
        pair
        for pair, sha256 in checksum_and_size(wanted).items()
        if sha256 not in there
    ]
    return wrong + [f"attempt {pair} of {session.id} is lost" for pair in lost]


def _left_behind(session: SessionFolder) -> list[Path]:
    paths = [p for pattern in LEFT_BEHIND for p in session.path.rglob(pattern)]
    return [path for path in paths if path.parent.name != "rejected"]
