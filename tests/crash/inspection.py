"""What the program makes of a disk after a power cut."""

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
FLUSHES = 3  # after so many there is more in a trial file than its header
Journals = dict[Path, list[dict]]  # events by folder, relative to the data


def acknowledged(operations: Sequence[Operation]) -> Journals:
    """Return the events of each session that are for good, by its folder.

    An event is for good from the moment at which the journal that has it was forced to
    the disk: the program tells the operator of it then.
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
    """Return how many trial files hold some recording that was forced to the disk."""
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
    """Return the events of a journal."""
    return [event for event in map(parse_line, journal.splitlines()) if event]


def checksum_and_size(events: Sequence[dict]) -> dict[tuple[int, int], str]:
    """Return {(trial, attempt): sha256} of what was ever kept."""
    return {
        (event["trial"], event["attempt"]): event["sha256"]
        for event in events
        if "sha256" in event
    }


def problems(root: Path, wanted: Journals, recorded: int) -> list[str]:
    """Return what is wrong with `root`/data, looked at and put in order.

    Args:
        root: what is on the disk after a power cut.
        wanted: the events that must not be lost, see `acknowledged`.
        recorded: how many recordings must be there, see `recordings`.
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
    """Return what is wrong with an answer; without a session 2 is right, too."""
    if done.code in {0, 6} or (is_empty and done.code == 2):
        return []
    return [f"{command} ends with {done.code}: {done.err}"]


def _lost(session: SessionFolder, wanted: Sequence[dict]) -> list[str]:
    """Return the events and trials that are not there, or are not what they were."""
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
