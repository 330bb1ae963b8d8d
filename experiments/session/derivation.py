"""Files derived from the journal: locations of trials, sidecars, session.json.

The journal is the only source. Only the figures of a recording that an older journal
does not state come from the sidecar, or from the recording itself.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from acquisition.errors import TrialFileError
from acquisition.trial_file.data_files import is_there
from experiments.session.data_files import (
    move_file,
    read_json,
    remove_file,
    sha256_of,
    write_json,
)
from experiments.session.reducer import SessionState, replay
from experiments.session.sidecar import Attempt, TrialOutcome, recording_of
from experiments.session.states import SessionPhase
from experiments.session.store import SUMMARY_FILE, SessionFolder

_SUFFIXES = (
    ".truth.mcap",
    ".mcap",
)  # the recording moves last: it identifies the others


def derive(folder: SessionFolder, state: SessionState) -> None:
    """Bring the files of a session in line with its journal.

    An interrupted call can be repeated; files already in line are not written.

    Args:
        folder: the session, its lock held.
        state: state after the whole journal.

    Raises:
        TrialFileError: the disk is full or unavailable, or another file is in the way.
    """
    if state.phase is SessionPhase.PLANNED:
        return  # any files are the only evidence of a lost journal
    recorded = [a for a in state.attempts if a.is_recorded or a.verdicts]
    for attempt in sorted(
        recorded, key=lambda a: not a.is_rejected
    ):  # frees names in trials/
        _derive_trial(folder, attempt, recorded)
    _write_changed(folder.path / SUMMARY_FILE, _summary_of(folder, state))


def sidecar_of(folder: SessionFolder, attempt: Attempt) -> dict[str, Any]:
    """Return the sidecar that an attempt should have, regardless of the file.

    Raises:
        TrialFileError: figures that only the sidecar has cannot be read at present.
    """
    other = {} if attempt.recording else _recording_from_files(folder, attempt)
    return attempt.sidecar(other)


def kept_sidecars(folder: SessionFolder) -> list[dict[str, Any]]:
    """Return the sidecars of the kept trials, in the order of their numbers."""
    kept = replay(folder.events()).kept_trials
    return [sidecar_of(folder, attempt) for attempt in kept]


def read_recording(path: Path) -> dict[str, object]:
    """Return the figures of a recording from its file.

    The file does not state the displacement, which is left at 0.
    """
    from acquisition.trial_file.reader import TrialReader
    from acquisition.trial_file.verify import verify_file

    try:
        verified = verify_file(path)
        result = TrialReader(path).metadata["result"]
    except TrialFileError:
        return recording_of(None, TrialOutcome("crash"))
    reason = result.get("stop_reason", "crash") if verified.is_complete else "crash"
    return recording_of(verified, TrialOutcome(reason))


def _derive_trial(
    folder: SessionFolder, attempt: Attempt, others: Sequence[Attempt]
) -> None:
    """Move the files of an attempt to their location and write its sidecar."""
    target, previous = (
        folder.path / attempt.relative_stem,
        _previous_path(folder, attempt),
    )
    has_moved = _is_at_previous_path(folder, attempt, others)
    for suffix in _SUFFIXES if has_moved else ():
        if is_there(_file(previous, suffix)):
            _move(_file(previous, suffix), _file(target, suffix))
    _write_changed(_file(target, ".json"), sidecar_of(folder, attempt))
    if has_moved and is_there(_file(previous, ".json")):
        remove_file(_file(previous, ".json"))


def _move(source: Path, target: Path) -> None:
    """Move a file; of two identical copies left by a kill, remove the source."""
    if is_there(target) and sha256_of(source) == sha256_of(target):
        remove_file(source)
    else:
        move_file(source, target)


def _previous_path(folder: SessionFolder, attempt: Attempt) -> Path:
    """Return the location of an attempt's files before the newest verdict."""
    name = attempt.name
    at_trials, at_rejected = folder.trials / name.kept, folder.rejected / name.rejected
    return at_trials if attempt.is_rejected else at_rejected


def _file(stem: Path, suffix: str) -> Path:
    return stem.with_name(stem.name + suffix)


def _is_at_previous_path(
    folder: SessionFolder, attempt: Attempt, others: Sequence[Attempt]
) -> bool:
    """Return whether files of an attempt are at its previous location.

    A name in rejected/ belongs to one attempt. In trials/ all attempts at a trial share
    one name: the checksum of the recording tells them apart, else the sidecar.
    """
    other = _previous_path(folder, attempt)
    if not attempt.is_rejected:
        return any(is_there(_file(other, s)) for s in (*_SUFFIXES, ".json"))
    is_named = _names_attempt(_file(other, ".json"), attempt)
    recording = _file(other, ".mcap")
    is_missing = bool(attempt.sha256) and not is_there(
        _file(folder.path / attempt.relative_stem, ".mcap")
    )
    if not (is_named or is_missing):
        return False
    if is_there(recording):
        digest = sha256_of(recording)
        for candidate in others:
            if candidate.sha256 == digest:
                return candidate.name == attempt.name
    return is_named


def _names_attempt(sidecar: Path, attempt: Attempt) -> bool:
    name = attempt.name
    fields = read_json(sidecar)
    named = fields.get("trial", name.kept), fields.get("attempt")
    return named == (name.kept, name.attempt)


def _recording_from_files(folder: SessionFolder, attempt: Attempt) -> dict[str, Any]:
    """Return the figures of a recording that the journal does not state."""
    stems = folder.path / attempt.relative_stem, _previous_path(folder, attempt)
    for stem in stems:
        if _names_attempt(_file(stem, ".json"), attempt):
            return read_json(_file(stem, ".json"))
    for stem in stems[:1] if attempt.is_rejected else stems:
        if is_there(_file(stem, ".mcap")):
            return read_recording(_file(stem, ".mcap"))
    return {}


def _summary_of(folder: SessionFolder, state: SessionState) -> dict[str, object]:
    """Return the content of session.json."""
    return {
        "id": folder.id,
        "phase": str(state.phase),
        "terrain": state.terrain,
        "simulated": folder.is_simulated,
        "operator": state.operator,
        "trials": state.wanted,
        "kept": [f"T{number:02d}" for number in state.kept],
        "rejected": state.rejected,
        "ended": state.ended,
        "events": folder.journal_text().count(b"\n"),
        "force_drift": list(state.drift) or None,
    }


def _write_changed(path: Path, content: dict[str, Any]) -> None:
    if read_json(path) != content:
        write_json(path, content)
