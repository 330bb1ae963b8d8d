"""conditions.json of a session: its recording conditions by name."""

from collections.abc import Mapping

from experiments.session.data_files import read_json, write_json
from experiments.session.store import SessionFolder

FILE = "conditions.json"


def write_conditions(folder: SessionFolder, values: Mapping[str, str]) -> None:
    """Write the conditions of a new session.

    Raises:
        TrialFileError: the disk is full or unavailable.
    """
    write_json(folder.path / FILE, dict(values))


def read_conditions(folder: SessionFolder) -> dict[str, str]:
    """Return the conditions of a session, empty if the file is damaged."""
    entries = read_json(folder.path / FILE)
    return {name: str(value) for name, value in entries.items()}
