"""Export of a terrain database for other programs."""

import hashlib
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from acquisition.files import read_regular
from acquisition.wording import counted
from analysis.terrains.database import LARGEST, load
from analysis.terrains.export.exported import TerrainExport
from analysis.terrains.export.folder import require_target, target_files
from experiments.operator.console import WARNING, Console
from experiments.session.data_files import make_empty, write_new


@dataclass(frozen=True, slots=True)
class TargetRequest:
    """Options of an export of terrains.

    Attributes:
        database: file of the terrain database.
        targets: names of the target programs.
        to: the folder, empty or new.
        terrains: names of the terrains; empty = all.
        model: name of the model; "" = the default.
        is_float: single precision in C.
    """

    database: Path
    targets: tuple[str, ...]
    to: Path
    terrains: tuple[str, ...]
    model: str
    is_float: bool


def export_for(request: TargetRequest, console: Console) -> None:
    """Write the folder of every target.

    Raises:
        MissingLibraryError: a target needs a library that is not installed.
        SettingsError: the database cannot be read or has no such terrain or model.
        SessionError: the folder is not empty.
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
    outputs = {name: target_files(name, export) for name in request.targets}
    make_empty(request.to)
    for name, files in outputs.items():
        for path, data in files.items():
            file = request.to / name / path
            file.parent.mkdir(parents=True, exist_ok=True)
            write_new(file, data)
        console.say(f"{name:10} {request.to / name}: {counted(len(files), 'file')}")
    if export.is_simulated:
        console.say(f"{WARNING} SIMULATED trials: every file says so.")
