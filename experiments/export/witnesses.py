"""What has to be in a publication, by its description and by the journals inside."""

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
_MOST = 100_000  # files and others that it names


def changed_publication(folder: Path) -> list[ChangedFile]:
    """Return every file of a publication that is missing or not as it was written.

    A list of checksums from which a line was taken says nothing of that file; the
    description of the crate and the journals of its sessions still name it.

    Raises:
        TrialFileError: the list is missing or none, or the description is none.
    """
    changes = changed_files(folder)
    known = {change.path for change in changes}
    if METADATA not in known and not (folder / METADATA).is_file():
        changes.append(ChangedFile(METADATA, "is missing"))
        known.add(METADATA)
    # a description that was changed itself is no witness
    for name in [] if METADATA in known else _described(folder / METADATA):
        if name not in known and not (folder / name).is_file():
            changes.append(ChangedFile(name, f"is missing; {METADATA} names it"))
            known.add(name)
    for session in list_sessions(folder):
        for deviation in compare_kept(session):
            path = str((session.path / deviation.file).relative_to(folder))
            if path not in known:
                changes.append(ChangedFile(path, deviation.problem))
                known.add(path)
    return changes


def _described(path: Path) -> list[str]:
    """Return the files below the crate that its description names.

    Its identifiers are addresses: "+" and other signs are written in percent.
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
        known = cast("dict[str, object]", entity if isinstance(entity, dict) else {})
        name = known.get("@id") if known.get("@type") == "File" else None
        if isinstance(name, str) and _is_below(file := unquote(name)):
            names.append(file)
    return names


def _is_below(name: str) -> bool:
    """Return whether a name is that of a file below the crate, and no address."""
    path = Path(name)
    return ":" not in name and not path.is_absolute() and ".." not in path.parts
