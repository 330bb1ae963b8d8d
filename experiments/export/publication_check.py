"""Verification of a publication by checksums, its description and its journals."""

from pathlib import Path
from typing import cast
from urllib.parse import unquote

from acquisition.errors import TrialFileError
from acquisition.files import read_regular
from experiments.export.checksums import ChangedFile, changed_files
from experiments.export.crate import METADATA
from experiments.session.data_files import parse_object, reading
from experiments.session.kept_files import compare_kept
from experiments.session.store import list_sessions

_LARGEST = 64_000_000  # bytes of the description
_MOST = 100_000  # entities in the description


def changed_publication(folder: Path) -> list[ChangedFile]:
    """Return the missing and changed files of a publication.

    A file whose line was removed from the list of checksums is still named by the
    description of the crate and by the journals.

    Raises:
        TrialFileError: the list is missing or invalid, or the description is invalid.
    """
    changes = changed_files(folder)
    reported = {change.path for change in changes}
    if METADATA not in reported and not (folder / METADATA).is_file():
        changes.append(ChangedFile(METADATA, "is missing"))
        reported.add(METADATA)
    # a changed description is no evidence
    for name in [] if METADATA in reported else _described(folder / METADATA):
        if name not in reported and not (folder / name).is_file():
            changes.append(ChangedFile(name, f"is missing; {METADATA} names it"))
            reported.add(name)
    for session in list_sessions(folder):
        for deviation in compare_kept(session):
            path = str((session.path / deviation.file).relative_to(folder))
            if path not in reported:
                changes.append(ChangedFile(path, deviation.problem))
                reported.add(path)
    return changes


def _described(path: Path) -> list[str]:
    """Return the files of the crate that its description names.

    Its identifiers are URIs, with "+" and other characters percent-encoded.
    """
    with reading(path):
        content = parse_object(read_regular(path, _LARGEST))
    graph = None if content is None else content.get("@graph")
    if not isinstance(graph, list):
        raise TrialFileError(path, "describes no crate")
    if len(cast("list[object]", graph)) > _MOST:
        raise TrialFileError(path, f"describes more than {_MOST} things")
    names: list[str] = []
    for entity in cast("list[object]", graph):
        fields = cast("dict[str, object]", entity if isinstance(entity, dict) else {})
        name = fields.get("@id") if fields.get("@type") == "File" else None
        if isinstance(name, str) and _is_below(file := unquote(name)):
            names.append(file)
    return names


def _is_below(name: str) -> bool:
    """Return whether a name is that of a file in the crate, not a URL."""
    path = Path(name)
    return ":" not in name and not path.is_absolute() and ".." not in path.parts
