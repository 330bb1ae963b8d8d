"""Recovery after a crash: files follow the journal, the cut trial is rejected."""

from pathlib import Path

from acquisition.clock import SystemClock
from acquisition.errors import SessionError, TrialFileError
from acquisition.temporary_folders import remove_abandoned
from acquisition.trial_file.data_files import is_claimed, is_there, list_folder
from acquisition.trial_file.recover import ROOM, recover_file, recovered_path
from experiments.session.data_files import move_file, remove_file
from experiments.session.derivation import derive, read_recording
from experiments.session.journal import Journal
from experiments.session.sidecar import TrialName
from experiments.session.states import OPEN, Event, SessionPhase
from experiments.session.store import SessionFolder

WHO = "traction"  # author of an automatic verdict
RECORDER_TIMEOUT_NS = (
    20_000_000_000  # to write and verify the longest trial takes a few s
)
_PAUSE_NS = 20_000_000
REPLACED = frozenset({".json", ".toml", ".patch", ".txt"})  # as a whole, atomically
REASON = "the session ended without closing"


def recover_session(journal: Journal) -> str:
    """Recover a session whose lock is held; returns what was moved to rejected/.

    Kept trials are not touched. The running trial is recovered and rejected, so that
    it is recorded again. A second call changes nothing.

    Raises:
        SessionError: a recorder is still writing a trial file of the session.
        TrialFileError: the disk is full or unavailable.
    """
    folder = journal.folder
    _wait_for_recorder(folder)
    _remove_temporary_files(folder)
    if journal.state.phase in OPEN:
        journal.append(Event.CRASH_FOUND)
    else:
        derive(folder, journal.state)
    number = journal.state.running
    if journal.state.phase is not SessionPhase.CRASHED or number is None:
        return ""
    name = TrialName(number, journal.state.attempt(number))
    details: dict[str, object] = {"trial": number, "attempt": name.attempt}
    if not journal.state.attempt_at(name).is_recorded:
        details["recording"] = _move_to_rejected(folder, name)
    journal.append(Event.TRIAL_REJECTED, **details, reason=REASON, who=WHO)
    return f"{name.kept} will be redone, its data are in rejected/{name.rejected}.*"


def _wait_for_recorder(folder: SessionFolder) -> None:
    """Wait until the recorder of a killed console has completed its file."""
    clock = SystemClock()
    end_ns = clock.now_ns() + RECORDER_TIMEOUT_NS
    while is_claimed(folder.trials):
        if clock.now_ns() >= end_ns:
            raise SessionError(
                f"The recorder still ends a trial file of {folder.id}.",
                hint="Wait a minute and try again. Nothing was changed.",
            )
        clock.sleep_until(clock.now_ns() + _PAUSE_NS)


def _move_to_rejected(folder: SessionFolder, name: TrialName) -> dict[str, object]:
    """Move the files of a trial to rejected/; returns the recording's figures."""
    path = folder.trials / f"{name.kept}.mcap"
    partial = path.with_name(path.name + ".partial")
    if is_there(partial) and not is_there(path):
        _recover(partial, path)
    for source, kind in (
        (partial, ".partial"),
        (_truth_path(partial), ".truth.partial"),
        (_truth_path(path), ".truth.mcap"),
        (path, ".mcap"),
    ):
        if is_there(source):
            move_file(source, folder.rejected / f"{name.rejected}{kind}")
    return read_recording(folder.rejected / f"{name.rejected}.mcap")


def _recover(partial: Path, path: Path) -> None:
    """Save the valid part of `partial` as `path`, if there is one."""
    try:
        recovered = recover_file(partial).path
    except TrialFileError:
        return
    move_file(recovered, path)
    path.chmod(0o444)


def _truth_path(path: Path) -> Path:
    return path.with_name(path.name.replace(".mcap", ".truth.mcap"))


def _remove_temporary_files(folder: SessionFolder) -> None:
    """Remove the remains of replacements that a kill interrupted."""
    for directory in (folder.path, folder.trials, folder.rejected):
        for path in list_folder(directory, "*.*.tmp"):
            if path.with_suffix("").suffix in REPLACED:
                remove_file(path)
        remove_abandoned(ROOM, directory)
    for path in list_folder(folder.trials, "*.mcap.partial"):
        finished = path.with_suffix("")
        for other in (path, recovered_path(path)):
            if is_there(other) and is_there(finished) and finished.samefile(other):
                remove_file(other)
