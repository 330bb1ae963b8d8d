"""conditions.json of a session: the conditions that it was recorded under, by name."""

from collections.abc import Mapping
from dataclasses import dataclass

from experiments.session.data_files import read_json, write_json
from experiments.session.store import SessionFolder

FILE = "conditions.json"
VERSION = 2  # of the file; 1 had no number
_VERSION_KEY = "version"


@dataclass(frozen=True, slots=True)
class Conditions:
    """What conditions.json of a session says.

    Attributes:
        version: of the file.
        values: of the conditions by name.
    """

    version: int
    values: Mapping[str, str]


def write_conditions(folder: SessionFolder, values: Mapping[str, str]) -> None:
    """Write the conditions of a new session.

    Raises:
        TrialFileError: the disk is full or gone.
    """
    write_json(folder.path / FILE, {_VERSION_KEY: VERSION, **values})


def read_conditions(folder: SessionFolder) -> Conditions:
    """Return the conditions of a session, none where the file is damaged."""
    entries = read_json(folder.path / FILE)
    version = entries.pop(_VERSION_KEY, 1)
    values = {name: str(value) for name, value in entries.items()}
    return Conditions(version if isinstance(version, int) else 1, values)
