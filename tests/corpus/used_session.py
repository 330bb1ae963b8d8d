"""A session of two kept trials and a rejected one, used while one file is hostile."""

import contextlib
import hashlib
import io
import tempfile
from functools import cache
from pathlib import Path

from acquisition.clock import SystemClock
from acquisition.trial_file.verify import verify_file
from acquisition.trial_file.writer import publish
from experiments.__main__ import main
from experiments.session.journal import Journal
from experiments.session.sidecar import TrialName, TrialOutcome, recording_of
from experiments.session.states import Event
from experiments.session.store import create_session
from tests.acquisition.trials import make_cycles, write_trial

SOUND_CODES = {0, 2, 5, 6}
CYCLES = 60
COMMANDS = (
    ("status", "--data", "."),
    ("verify", "--all", "--data", "."),
    ("note", "S001", "T01", "seen", "--data", "."),
    ("verdict", "S001", "T01", "reject", "why", "--data", "."),
    ("verdict", "S001", "T01b", "keep", "why", "--data", "."),
)


class HalfDoneError(Exception):
    """A command has left inconsistent files, or has ended as a bug."""


@cache
def session_files() -> dict[str, bytes]:
    """Files of the data folder of the session, by their path below that folder."""
    with tempfile.TemporaryDirectory(prefix="corpus-") as scratch:
        data = Path(scratch)
        folder = create_session(data, "TF", is_simulated=True, utc_ns=1_800 * 10**15)
        journal = Journal(folder, SystemClock())
        journal.append(Event.STARTED, terrain="TF", trials=2)
        journal.append(Event.ACTIVATED)
        for number, attempt, verdict in (
            (1, 1, Event.TRIAL_REJECTED),
            (1, 2, Event.TRIAL_KEPT),
            (2, 1, Event.TRIAL_KEPT),
        ):
            _record(journal, TrialName(number, attempt), verdict)
        journal.append(Event.ENDED, reason="complete")
        files = (path for path in data.rglob("*") if path.is_file())
        return {str(path.relative_to(data)): path.read_bytes() for path in files}


def session_file(name: str) -> bytes:
    """Content of the file of the session whose path ends in `name`."""
    (content,) = (c for path, c in session_files().items() if path.endswith(name))
    return content


def _record(journal: Journal, name: TrialName, verdict: Event) -> None:
    fields = {"trial": name.number, "attempt": name.attempt}
    journal.append(Event.TRIAL_STARTED, **fields)
    path = journal.folder.trials / f"{name.kept}.mcap"
    cycles = make_cycles(CYCLES, seed=10 * name.number + name.attempt)
    writer = write_trial(path, cycles, block=CYCLES // 2)
    writer.finish("travel")
    publish(writer)
    recording = recording_of(verify_file(path), TrialOutcome("travel"))
    journal.append(Event.TRIAL_RECORDED, **fields, recording=recording)
    journal.append(verdict, **fields, reason="", who="mk")


def lay_out(folder: Path) -> Path:
    """Write the data with the session into `folder`; the same folder."""
    for name, content in session_files().items():
        target = folder / name
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(content)
    return folder


def use(name: str, data: bytes, folder: Path) -> None:
    """Run commands on the session, with `data` in place of its file `name`.

    Raises:
        HalfDoneError: a command ended as a bug, or recordings and sidecars disagree.
    """
    for path, content in session_files().items():
        target = folder / path
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(data if path.endswith(name) else content)
    before = _sums(folder)
    for command in COMMANDS:
        printed(*command)
        if not name.endswith(".mcap") and _sums(folder) != before:
            raise HalfDoneError(f"{command[0]} lost or doubled a recording")
        if name.endswith(".json"):
            _check_pairs(folder, command[0])


def printed(*command: str) -> tuple[int, str]:
    """Exit code of a command and its output, or its errors if there is none.

    Raises:
        HalfDoneError: the command ended as a bug.
    """
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main(command)
    if code not in SOUND_CODES:
        raise HalfDoneError(f"{command} ended with {code}: {err.getvalue()}")
    return code, out.getvalue() or err.getvalue()


def _sums(folder: Path) -> list[str]:
    """Checksums of all trial files."""
    paths = folder.rglob("*.mcap")
    return sorted(hashlib.sha256(path.read_bytes()).hexdigest() for path in paths)


def _check_pairs(folder: Path, command: str) -> None:
    """Require a sidecar for every recording, and a recording for every sidecar."""
    for name in ("trials", "rejected"):
        files = list(folder.glob(f"sessions/*/{name}/T*"))
        recordings = {path.stem for path in files if path.suffix == ".mcap"}
        sidecars = {path.stem for path in files if path.suffix == ".json"}
        if recordings != sidecars:
            raise HalfDoneError(f"{command} left {recordings} and {sidecars} apart")
