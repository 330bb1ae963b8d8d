"""Files of a session that follow from its journal: places, sidecars, session.json.

The journal decides; nothing here is read to learn what it says. Only the numbers of a
recording that an older journal does not state are taken from the sidecar, or from the
recording itself.
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

_SUFFIXES = (".truth.mcap", ".mcap")  # what moves last shows whose the others are


def derive(folder: SessionFolder, state: SessionState) -> None:
    """Bring the files of a session in line with what its journal gives.

    A call that was cut short can be repeated; where all is in line nothing is written.

    Args:
        folder: the session, its lock held.
        state: what its whole journal gives.

    Raises:
        TrialFileError: the disk is full or gone, or another file stands in the way.
    """
    if state.phase is SessionPhase.PLANNED:
        return  # what else is there would be the only witness of a lost journal
    recorded = [a for a in state.attempts if a.is_recorded or a.verdicts]
    for attempt in sorted(recorded, key=lambda a: not a.is_rejected):  # makes room
        _derive_trial(folder, attempt, recorded)
    _write_changed(folder.path / SUMMARY_FILE, _summary_of(folder, state))


def sidecar_of(folder: SessionFolder, attempt: Attempt) -> dict[str, Any]:
    """Return what the sidecar of an attempt has to say, whatever it says now.

    Raises:
        TrialFileError: what the journal left to the sidecar cannot be read now.
    """
    other = {} if attempt.recording else _recording_elsewhere(folder, attempt)
    return attempt.sidecar(other)


def kept_sidecars(folder: SessionFolder) -> list[dict[str, Any]]:
    """Return the sidecars of the kept trials, in the order of their numbers."""
    kept = replay(folder.events()).kept_trials
    return [sidecar_of(folder, attempt) for attempt in kept]


def read_recording(path: Path) -> dict[str, object]:
    """Return the numbers of a recording as its file shows them.

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
    """Give the files of an attempt their place, and its sidecar its content."""
    place, other = folder.path / attempt.place, _other_place(folder, attempt)
    is_elsewhere = _is_elsewhere(folder, attempt, others)
    for suffix in _SUFFIXES if is_elsewhere else ():
        if is_there(_file(other, suffix)):
            _move(_file(other, suffix), _file(place, suffix))
    _write_changed(_file(place, ".json"), sidecar_of(folder, attempt))
    if is_elsewhere and is_there(_file(other, ".json")):
        remove_file(_file(other, ".json"))


def _move(source: Path, target: Path) -> None:
    """Move a file; in a copy of a session that a kill had left in both places, once."""
    if is_there(target) and sha256_of(source) == sha256_of(target):
        remove_file(source)
    else:
        move_file(source, target)


def _other_place(folder: SessionFolder, attempt: Attempt) -> Path:
    """Return where the files of an attempt stood before the newest verdict."""
    name = attempt.name
    at_trials, at_rejected = folder.trials / name.kept, folder.rejected / name.rejected
    return at_trials if attempt.is_rejected else at_rejected


def _file(stem: Path, suffix: str) -> Path:
    return stem.with_name(stem.name + suffix)


def _is_elsewhere(
    folder: SessionFolder, attempt: Attempt, others: Sequence[Attempt]
) -> bool:
    """Return whether files of an attempt are at its other place.

    A name in rejected/ is that of one attempt. In trials/ all attempts at a trial have
    the same: the checksum of the recording tells them apart, else the sidecar.
    """
    other = _other_place(folder, attempt)
    if not attempt.is_rejected:
        return any(is_there(_file(other, s)) for s in (*_SUFFIXES, ".json"))
    states_it = _states(_file(other, ".json"), attempt)
    recording = _file(other, ".mcap")
    is_missed = bool(attempt.sha256) and not is_there(
        _file(folder.path / attempt.place, ".mcap")
    )
    if not (states_it or is_missed):
        return False
    if is_there(recording):
        digest = sha256_of(recording)
        for one in others:
            if one.sha256 == digest:
                return one.name == attempt.name
    return states_it


def _states(sidecar: Path, attempt: Attempt) -> bool:
    name = attempt.name
    fields = read_json(sidecar)
    named = fields.get("trial", name.kept), fields.get("attempt")
    return named == (name.kept, name.attempt)


def _recording_elsewhere(folder: SessionFolder, attempt: Attempt) -> dict[str, Any]:
    """Return the numbers of a recording of which the journal states none."""
    stems = folder.path / attempt.place, _other_place(folder, attempt)
    for stem in stems:
        if _states(_file(stem, ".json"), attempt):
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
