"""Terrains of a database for other programs: read, made, and only then written."""

import csv
import hashlib
import io
from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path

from acquisition.errors import SettingsError
from acquisition.files import UnfitFileError, read_regular
from analysis.exports.folder import require_target, target_files
from analysis.exports.source import ExportOptions, TerrainExport
from analysis.terrains.database import LARGEST, load
from experiments.operator.console import WARNING, Console
from experiments.report.export import make_empty
from experiments.session.data_files import write_new

_LARGEST_GRID = 4_000_000  # bytes
_MOST_CELLS = 1_000  # of a side
_NOTHING = "Nothing was written."


@dataclass(frozen=True, slots=True)
class TargetRequest:
    """What is exported for whom.

    Attributes:
        database: file of the terrains.
        targets: names of the programs.
        to: the folder, empty or new.
        terrains: names; all where empty.
        model: its name; "" = the default.
        options: what is asked of the targets.
        grid: CSV of names that says which terrain stands where; None = one patch each.
    """

    database: Path
    targets: tuple[str, ...]
    to: Path
    terrains: tuple[str, ...]
    model: str
    options: ExportOptions
    grid: Path | None


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
    options = request.options
    if request.grid is not None:
        names = request.terrains or tuple(database.terrains)
        options = replace(options, grid=read_grid(request.grid, names))
    export = TerrainExport.of(
        database,
        hashlib.sha256(content).hexdigest(),
        version("traction"),
        request.terrains,
        request.model,
        options,
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
    if any(t.profile.level_sd is None for t in export.terrains):
        console.say(
            f"{WARNING} The model knows no effect of a trial: friction per episode is "
            "one number. Those of a new trial have it, e.g. gp_se_trial."
        )


def read_grid(path: Path, names: Sequence[str]) -> tuple[tuple[str, ...], ...]:
    """Return the terrain of every cell of a map, "" = unknown.

    Args:
        path: CSV of names, the first row at the largest x, the first column at the
            largest y.
        names: of the terrains there are.

    Raises:
        SettingsError: it cannot be read, is no rectangle or has an unknown name.
    """
    try:
        content = read_regular(path, _LARGEST_GRID, is_link_followed=True)
        rows = list(csv.reader(io.StringIO(content.decode("utf-8-sig"), newline="")))
    except UnfitFileError as error:
        raise _no_grid(path, f"it {error}") from error
    except OSError as error:
        raise _no_grid(path, f"it cannot be read ({error.strerror})") from error
    except (ValueError, csv.Error) as error:
        raise _no_grid(path, f"it is no CSV ({error})") from error
    cells = tuple(tuple(cell.strip() for cell in row) for row in rows if row)
    widths = {len(row) for row in cells}
    if len(widths) != 1 or max(len(cells), *widths) > _MOST_CELLS:
        raise _no_grid(path, "it is no rectangle of 1 to 1000 cells a side")
    known = {"", *names}
    for number, row in enumerate(cells, 1):
        for cell in row:
            if cell not in known:
                raise _no_grid(path, f"row {number} names the terrain {cell!r:.60}")
    return cells


def _no_grid(path: Path, what: str) -> SettingsError:
    return SettingsError(
        f"--grid {path}: {what}.",
        hint=f"A CSV with the name of a terrain, or nothing, in every cell. {_NOTHING}",
    )
