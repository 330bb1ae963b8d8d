"""Terrains of a database for other programs: read, made, and only then written."""

import hashlib
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from acquisition.files import read_regular
from analysis.terrains.database import LARGEST, load
from analysis.terrains.export.exported import TerrainExport
from analysis.terrains.export.folder import require_target, target_files
from experiments.export.trial_tables import make_empty
from experiments.operator.console import WARNING, Console
from experiments.session.data_files import write_new


@dataclass(frozen=True, slots=True)
class TargetRequest:
    """What is exported for whom.

    Attributes:
        database: file of the terrains.
        targets: names of the programs.
        to: the folder, empty or new.
        terrains: names; all where empty.
        model: its name; "" = the default.
        is_float: single precision in C.
    """

    database: Path
    targets: tuple[str, ...]
    to: Path
    terrains: tuple[str, ...]
    model: str
    is_float: bool


def export_for(request: TargetRequest, console: Console) -> None:
    """Write the folder of every target below the one that is asked for.

    Raises:
        MissingLibraryError: a target needs a library that is not installed.
        SettingsError: the database cannot be read or has no such terrain or model.
        SessionError: the folder holds something.
        TrialFileError: a file cannot be written.
    """
    for name in request.targets:
        require_target(name)
    database = load(request.database)
    content = read_regular(request.database, LARGEST, is_link_followed=True)
    export = TerrainExport.of(
        database,
        hashlib.sha256(content).hexdigest(),
        version("traction"),
        request.terrains,
        request.model,
        is_float=request.is_float,
    )
    made = {name: target_files(name, export) for name in request.targets}
    make_empty(request.to)
    for name, files in made.items():
        for path, data in files.items():
            file = request.to / name / path
            file.parent.mkdir(parents=True, exist_ok=True)
            write_new(file, data)
        console.say(f"{name:10} {request.to / name}: {len(files)} files")
    if export.is_simulated:
        console.say(f"{WARNING} SIMULATED trials: every file says so.")
