"""Compare the kept trials of the journal with the files: missing, changed."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from acquisition.errors import SessionError, TrialFileError
from acquisition.trial_file.data_files import is_there, list_folder
from experiments.session.data_files import read_json, sha256_of
from experiments.session.sidecar import KEEP, Attempt, TrialName, checksum_and_size
from experiments.session.states import Event
from experiments.session.store import (
    JOURNAL_FILE,
    SUMMARY_FILE,
    JournalContent,
    SessionFolder,
)

_NAMED = 6  # deviations in one message
_Facts = Mapping[str, Any]


class KeptDataError(SessionError):
    """Kept trials are missing or contradict the journal."""

    exit_code = 6


@dataclass(frozen=True, slots=True)
class Deviation:
    """One file of a session that contradicts the journal.

    Attributes:
        session: id of the session.
        file: path relative to the folder of the session.
        problem: description of the fault.
    """

    session: str
    file: str
    problem: str

    def text(self) -> str:
        """Return the deviation in one line."""
        return f"{self.session} {self.file} {self.problem}"


def compare_kept(
    folder: SessionFolder,
    digest: Callable[[Path], str] = sha256_of,
    journal: JournalContent | None = None,
) -> list[Deviation]:
    """Return every kept trial that is missing or changed, in the order of trials.

    A trial whose files have not been moved yet as the journal demands is no deviation.

    Args:
        folder: the session.
        digest: function that computes the checksum of a file.
        journal: its journal, if it was read already.
    """
    try:
        content = journal or folder.journal()
        pairs = _compare(folder, content, digest)
        return [Deviation(folder.id, *pair) for pair in pairs]
    except TrialFileError as error:
        return [unreadable(folder, error)]


def journal_deviations(folder: SessionFolder) -> list[Deviation]:
    """Return where the journal is damaged or lags behind the files derived from it.

    Nothing may be derived from such a journal: what it has lost would be rejected, and
    what shows the loss overwritten.
    """
    try:
        content = folder.journal()
        pairs = [*_journal_faults(folder, content), *_unknown_sidecars(folder, content)]
        return [Deviation(folder.id, *pair) for pair in pairs]
    except TrialFileError as error:
        return [unreadable(folder, error)]


def require_sound_journal(folder: SessionFolder) -> None:
    """Refuse to write to a session whose journal is damaged or lags behind.

    Raises:
        KeptDataError: there are `journal_deviations`.
    """
    if deviations := journal_deviations(folder):
        raise kept_data_error(
            deviations,
            "Copy the files back, or go on without them: "
            f"traction resume {folder.id} --allow-missing. Nothing was written.",
        )


def _compare(
    folder: SessionFolder, journal: JournalContent, digest: Callable[[Path], str]
) -> list[tuple[str, str]]:
    """Return (file, problem) of every deviation.

    Raises:
        TrialFileError: a folder cannot be read.
    """
    faults = _journal_faults(folder, journal)
    for attempt in journal.state.kept_trials:
        try:
            faults += _check_trial(folder, attempt, digest)
        except TrialFileError as error:
            faults.append((_relative_path(folder, error), error.reason))
    for file, problem in _unknown_sidecars(folder, journal):
        faults.append((file, problem))
        fields = read_json(folder.path / file)
        stem, attempt = Path(file).stem, fields.get("attempt")
        attempt = attempt if type(attempt) is int else 1
        name = TrialName(int(stem[1:]), attempt) if stem[1:].isdigit() else None
        if name is not None:  # only the sidecar has the checksum
            orphan = Attempt(name, sums=checksum_and_size(fields))
            faults += _check_trial(folder, orphan, digest)
    return faults


def _judged(journal: JournalContent) -> set[TrialName]:
    return {a.name for a in journal.state.attempts if a.verdicts}


def _journal_faults(
    folder: SessionFolder, journal: JournalContent
) -> list[tuple[str, str]]:
    """Return (file, problem) where the journal is damaged or contradicts the folder."""
    faults = [(JOURNAL_FILE, fault) for fault in journal.faults]
    if (deviation := name_contradiction(folder, journal.events)) is not None:
        faults.append((deviation.file, deviation.problem))
    judged = {name.kept for name in _judged(journal)}
    return faults + _unknown_to_journal(folder, journal.text, judged)


def _unknown_sidecars(
    folder: SessionFolder, journal: JournalContent
) -> list[tuple[str, str]]:
    """Return (file, problem) of the sidecars of kept trials without a verdict."""
    judged = _judged(journal)
    faults: list[tuple[str, str]] = []
    for path in list_folder(folder.trials, "T??.json"):
        fields = read_json(path)
        attempt = fields.get("attempt")
        is_judged = any(n.kept == path.stem and n.attempt == attempt for n in judged)
        if fields.get("verdict") == KEEP and not is_judged:
            faults.append((f"trials/{path.name}", "is kept, but is not in the journal"))
    return faults


def _unknown_to_journal(
    folder: SessionFolder, text: bytes, judged: Collection[str]
) -> list[tuple[str, str]]:
    """Return the faults that session.json reveals in the journal.

    session.json is written after the journal: it may lag behind, but never contains
    more.

    Args:
        folder: the session.
        text: the journal.
        judged: names of the trials with a verdict in the journal.
    """
    summary = read_json(folder.path / SUMMARY_FILE)
    listed = summary.get("kept")
    names = cast("list[object]", listed if isinstance(listed, list) else [])
    summarised = [str(name) for name in names]
    faults: list[tuple[str, str]] = []
    if origin := stated_id(folder):
        faults.append((SUMMARY_FILE, f"is of {origin}: a copy, or a renamed session"))
    lines, stated = text.count(b"\n"), summary.get("events")
    if lines > 1 and not (summary and isinstance(summary.get("kept", []), list)):
        faults.append((SUMMARY_FILE, "is missing or damaged"))
    lost = [name for name in summarised if name not in judged]
    if not text and (summarised or stated):
        faults.append((JOURNAL_FILE, f"is missing or empty; {SUMMARY_FILE} is not"))
    elif type(stated) is int and lines < stated:
        faults.append((JOURNAL_FILE, f"ends after {lines} of {stated} lines"))
    for name in lost:
        faults.append(
            (f"trials/{name}.mcap", f"is kept in {SUMMARY_FILE}, not in the journal")
        )
    return faults


def name_contradiction(
    folder: SessionFolder, events: Sequence[_Facts]
) -> Deviation | None:
    """Return how journal or session.json contradict the folder's name, or None.

    The name decides for which terrain a session counts, and whether as simulated; both
    files state the same.
    """
    summary = read_json(folder.path / SUMMARY_FILE)
    stated = summary.get("simulated")
    if isinstance(stated, bool) and stated is not folder.is_simulated:
        return _wrong_kind(folder, SUMMARY_FILE, is_simulated=stated)
    is_started = bool(events) and events[0].get("event") == Event.STARTED
    first: _Facts = events[0] if is_started else {}
    for file, stated_by in ((JOURNAL_FILE, first), (SUMMARY_FILE, summary)):
        terrain = stated_by.get("terrain", folder.terrain)
        if terrain != folder.terrain:
            return _wrong_terrain(folder, file, terrain)
    if not is_started:
        return None
    is_simulated = first.get("fake", folder.is_simulated or None) is not None
    if is_simulated is not folder.is_simulated:
        return _wrong_kind(folder, JOURNAL_FILE, is_simulated=is_simulated)
    return None


def _wrong_terrain(folder: SessionFolder, file: str, terrain: object) -> Deviation:
    return Deviation(folder.id, file, f"is of {terrain}: a renamed session")


def _wrong_kind(folder: SessionFolder, file: str, *, is_simulated: bool) -> Deviation:
    kind = "simulated" if is_simulated else "recorded"
    return Deviation(folder.id, file, f"is of {kind} trials: a renamed session")


def repeated_numbers(folders: Sequence[SessionFolder]) -> dict[Path, Deviation]:
    """Deviations of the sessions whose number an earlier session has, by folder."""
    first: dict[str, SessionFolder] = {}
    return {
        folder.path: Deviation(
            folder.id, folder.path.name, f"has the number of {original.path.name}"
        )
        for folder in folders
        if (original := first.setdefault(folder.id, folder)) is not folder
    }


def stated_id(folder: SessionFolder) -> str:
    """Return the id in session.json if it differs from the folder's, else ""."""
    stated = read_json(folder.path / SUMMARY_FILE).get("id")
    return stated if isinstance(stated, str) and stated != folder.id else ""


def repeated_trials(folder: SessionFolder, original: SessionFolder) -> set[str]:
    """Names of the trials that a copied session shares with its original."""
    sums = [
        {kept.name.kept: kept.sha256 for kept in session.journal().state.kept_trials}
        for session in (folder, original)
    ]
    return {name for name, sha256 in sums[0].items() if sums[1].get(name) == sha256}


def _relative_path(folder: SessionFolder, error: TrialFileError) -> str:
    """File of an error, relative to the folder of the session."""
    is_below = error.path.is_relative_to(folder.path)
    return str(error.path.relative_to(folder.path) if is_below else error.path)


def unreadable(folder: SessionFolder, error: TrialFileError) -> Deviation:
    """Return an unreadable file as a deviation."""
    return Deviation(folder.id, _relative_path(folder, error), error.reason)


def compare_trial(folder: SessionFolder, path: Path) -> list[Deviation]:
    """Deviations of one trial, as of `compare_kept`."""
    return [d for d in compare_kept(folder) if Path(d.file).stem == path.stem]


def check_kept(
    sessions: Sequence[SessionFolder], *, allow_missing: bool
) -> list[Deviation]:
    """Return the deviations of all `sessions`; refuses them unless allowed.

    Raises:
        KeptDataError: there are deviations, and `allow_missing` is false.
    """
    deviations = [d for session in sessions for d in compare_kept(session)]
    if deviations and not allow_missing:
        raise kept_data_error(deviations)
    return deviations


def kept_data_error(
    deviations: Sequence[Deviation],
    hint: str = "Copy the files back, or go on without them: --allow-missing.",
) -> KeptDataError:
    """Return the error for data that contradict the journal."""
    named = "; ".join(d.text() for d in deviations[:_NAMED])
    more = f"; and {len(deviations) - _NAMED} more" if deviations[_NAMED:] else ""
    return KeptDataError(f"Not as in the journal: {named}{more}.", hint=hint)


def _check_trial(
    folder: SessionFolder, kept: Attempt, digest: Callable[[Path], str]
) -> list[tuple[str, str]]:
    """Return (file, problem) for each faulty file of a kept trial.

    Its files may not have been moved yet as the journal demands.
    """
    name = kept.name
    stems = (folder.trials / name.kept, folder.rejected / name.rejected)
    sidecars = [read_json(stem.with_name(f"{stem.name}.json")) for stem in stems]
    own = [s for s in sidecars if s.get("attempt") == name.attempt]
    faults: list[tuple[str, str]] = []
    if not own:
        faults.append((f"trials/{name.kept}.json", "is missing or unreadable"))
    elif own[0].get("sha256") != kept.sha256:
        faults.append((f"trials/{name.kept}.json", "states another checksum"))
    if folder.find_kept(kept, digest) is not None:
        return faults
    recordings = (stem.with_name(f"{stem.name}.mcap") for stem in stems)
    path = next((path for path in recordings if is_there(path)), None)
    problem = _change_text(path.stat().st_size, kept.size) if path else "is missing"
    return [*faults, (f"trials/{name.kept}.mcap", problem)]


def _change_text(size: int, before: object) -> str:
    if type(before) is not int or size == before:
        return "is changed: its checksum is wrong"
    return f"is changed: {size} bytes, {before} were kept"
