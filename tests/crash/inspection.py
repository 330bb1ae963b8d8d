"""Inspect the files that the program recovers from a disk after a power cut."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from acquisition.clock import SystemClock
from experiments.session.crash_recovery import recover_session
from experiments.session.data_files import parse_journal
from experiments.session.journal import open_journal
from experiments.session.lock import session_lock
from experiments.session.reducer import replay
from experiments.session.store import JOURNAL_FILE, SessionFolder, list_sessions
from experiments.session.unfinished import find_unfinished
from tests.crash.disk import after_all
from tests.crash.syscalls import Link, Operation, SyncFile
from tests.experiments.program import Done, digest, traction

CLOCK = SystemClock()
LEFTOVERS = ("*.tmp", "*.mcap.partial", ".recover-*")
FLUSHES = 3  # after these a trial file contains more than its header
Journals = dict[Path, list[dict]]  # events by folder, relative to the data


def acknowledged(operations: Sequence[Operation]) -> Journals:
    """Return the durable events of each session, by its folder.

    An event is durable once its journal was synced to the disk; the program reports
    the event to the operator only then.
    """
    names = after_all(operations).names
    journals = {n: path for path, n in names.items() if path.name == JOURNAL_FILE}
    last = {o.file: i for i, o in enumerate(operations) if isinstance(o, SyncFile)}
    return {
        path.parent: events_in(after_all(operations[: last[n]]).contents.get(n, b""))
        for n, path in journals.items()
        if n in last
    }


def recordings(operations: Sequence[Operation]) -> int:
    """Return the number of trial files with synced samples."""
    syncs = Counter(o.file for o in operations if isinstance(o, SyncFile))
    begun = {
        operation.file
        for operation in operations
        if isinstance(operation, Link) and _is_trial(operation.path)
    }
    return sum(syncs[file] >= FLUSHES for file in begun)


def _is_trial(path: Path) -> bool:
    return ".mcap" in path.name and not {"truth", "recovered"} & {*path.name.split(".")}


def events_in(journal: bytes) -> list[dict]:
    """Return the events of a journal."""
    return parse_journal(journal)[0]


def kept_checksums(events: Sequence[dict]) -> dict[tuple[int, int], str]:
    """Return {(trial, attempt): sha256} of all attempts kept at any time."""
    return {
        (event["trial"], event["attempt"]): event["sha256"]
        for event in events
        if "sha256" in event
    }


def find_problems(root: Path, wanted: Journals, recorded: int) -> list[str]:
    """Return the problems of `root`/data after reading and recovering the sessions.

    Args:
        root: folder with the files after a power cut.
        wanted: events that must not be lost, see `acknowledged`.
        recorded: number of recordings that must exist, see `recordings`.
    """
    problems, data = [], root / "data"
    commands = [("status",), ("verify", "--all"), ("recover", data), ("status",)]
    for words in commands if data.exists() else commands[:2]:
        options = () if words[0] == "recover" else ("--data", data)
        is_empty = not list_sessions(data)
        problems += _exit_code_problem(
            words[0], traction(*words, *options), is_empty=is_empty
        )
    find_unfinished(data)
    sessions = {session.path: session for session in list_sessions(data)}
    problems += [f"{path} is missing" for path in wanted if root / path not in sessions]
    repair_sessions(data)
    for path, session in sessions.items():
        problems += _losses(session, wanted.get(path.relative_to(root), []))
        problems += [f"{path} is left over" for path in _left_over(session)]
    files = [path for path in data.rglob("T*.mcap") if _is_trial(path)]
    problems += [f"{len(files)} of {recorded} recordings"] * (len(files) < recorded)
    done = traction("verify", "--all", "--data", data)
    is_wrong = bool(done.code) and bool(sessions)
    return problems + ([f"verify: {done.err}{done.out}"] if is_wrong else [])


def repair_sessions(data: Path) -> None:
    """Recover every session below `data`, as on its next opening."""
    for session in list_sessions(data):
        with session_lock(session):
            recover_session(open_journal(session, CLOCK))


def _exit_code_problem(command: str, done: Done, *, is_empty: bool) -> list[str]:
    """Return the problem with a command's exit code; 2 is allowed without a session."""
    if done.code in {0, 6} or (is_empty and done.code == 2):
        return []
    return [f"{command} ends with {done.code}: {done.err}"]


def _losses(session: SessionFolder, wanted: Sequence[dict]) -> list[str]:
    """Return the events and trials that are missing or changed."""
    events = session.events()
    losses = [] if events[: len(wanted)] == wanted else ["events are lost"]
    counted = {path.stem: digest(path) for path in session.kept_trials()}
    sums = kept_checksums(events)
    for number, attempt in replay(events).kept_attempts:
        if counted.get(f"T{number:02d}") != sums[number, attempt]:
            losses.append(f"T{number:02d} of {session.id} is not a kept trial")
    files = [*session.trials.glob("*.mcap"), *session.rejected.glob("*.mcap")]
    existing = {digest(path) for path in files}
    lost = [
        pair
        for pair, sha256 in kept_checksums(wanted).items()
        if sha256 not in existing
    ]
    return losses + [f"attempt {pair} of {session.id} is lost" for pair in lost]


def _left_over(session: SessionFolder) -> list[Path]:
    paths = [p for pattern in LEFTOVERS for p in session.path.rglob(pattern)]
    return [path for path in paths if path.parent.name != "rejected"]
