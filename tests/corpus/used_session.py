"""Run commands on a session of two kept and one rejected trial with a damaged file."""

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
    """A command left inconsistent files or ended with a bug."""


@cache
def session_files() -> dict[str, bytes]:
    """Return the content of the session's files by their path in the data folder."""
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
    """Return the content of the session file whose path ends in `name`."""
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
    """Write the session into the data folder `folder`; return `folder`."""
    for name, content in session_files().items():
        target = folder / name
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(content)
    return folder


def run_commands(name: str, data: bytes, folder: Path) -> None:
    """Run commands on the session, with `data` as the content of its file `name`.

    Raises:
        HalfDoneError: a command ended with a bug, or recordings and sidecars disagree.
    """
    for path, content in session_files().items():
        target = folder / path
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(data if path.endswith(name) else content)
    before = _sums(folder)
    for command in COMMANDS:
        run_command(*command)
        if not name.endswith(".mcap") and _sums(folder) != before:
            raise HalfDoneError(f"{command[0]} lost or duplicated a recording")
        if name.endswith(".json"):
            _check_pairs(folder, command[0])


def run_command(*command: str) -> tuple[int, str]:
    """Return the exit code of a command and its output, or its errors if none.

    Raises:
        HalfDoneError: the command ended with a bug.
    """
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main(command)
    if code not in SOUND_CODES:
        raise HalfDoneError(f"{command} ended with {code}: {err.getvalue()}")
    return code, out.getvalue() or err.getvalue()


def _sums(folder: Path) -> list[str]:
    """Return the checksums of all trial files."""
    paths = folder.rglob("*.mcap")
    return sorted(hashlib.sha256(path.read_bytes()).hexdigest() for path in paths)


def _check_pairs(folder: Path, command: str) -> None:
    """Require a sidecar for every recording, and a recording for every sidecar."""
    for name in ("trials", "rejected"):
        files = list(folder.glob(f"sessions/*/{name}/T*"))
        recordings = {path.stem for path in files if path.suffix == ".mcap"}
        sidecars = {path.stem for path in files if path.suffix == ".json"}
        if recordings != sidecars:
            raise HalfDoneError(f"{command} left {recordings} without {sidecars}")
