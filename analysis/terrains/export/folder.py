"""Folder of an export target: its files, a README and `source.json`."""

import importlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from acquisition.errors import SettingsError
from acquisition.extras import require_extra
from analysis.terrains.export.exported import TerrainExport
from analysis.terrains.export.names import TARGETS, target_names

README, SOURCE = "README.md", "source.json"
Files = Mapping[str, bytes]


@dataclass(frozen=True, slots=True)
class ExportTarget:
    """Export format; each module of `targets` defines one as `TARGET`.

    Attributes:
        title: title of the README.
        files: function that returns file contents by path below the folder.
        about: function that returns six lines of the README: content, use, limits.
        extra: optional dependency of Traction that the target needs; "" = none.
    """

    title: str
    files: Callable[[TerrainExport], Files]
    about: Callable[[TerrainExport], tuple[str, str, str, str, str, str]]
    extra: str = ""


def parse_targets(text: str) -> tuple[str, ...]:
    """Parse a list of targets such as "c,onnx".

    Raises:
        SettingsError: a target does not exist or is named twice.
    """
    names = tuple(name.strip() for name in text.split(",") if name.strip())
    unknown = [name for name in names if name not in target_names()]
    if unknown or not names or len(set(names)) < len(names):
        what = f"no target {', '.join(unknown)}" if unknown else "not a list of targets"
        raise SettingsError(
            f"--for {text:.80}: {what:.200}.",
            hint=f"Name each once, with commas between: {', '.join(target_names())}. "
            "Nothing was written.",
        )
    return names


def require_target(name: str) -> None:
    """Check that the libraries of a target are installed, before anything is read.

    Raises:
        MissingLibraryError: the target needs a library that is not installed.
    """
    if extra := _target(name).extra:
        require_extra(extra)


def _target(name: str) -> ExportTarget:
    return importlib.import_module(f"{TARGETS}.{name}").TARGET


def target_files(name: str, export: TerrainExport) -> dict[str, bytes]:
    """Return the files of a target, README and origin included, by path.

    Raises:
        SettingsError: the target cannot be made from this database.
        MissingLibraryError: the target needs a library that is not installed.
    """
    require_target(name)
    target = _target(name)
    files = dict(target.files(export))
    source = json.dumps({"target": name, **export.source()}, indent=1)
    return {
        **files,
        README: _readme(target, export).encode(),
        SOURCE: f"{source}\n".encode(),
    }


def _readme(target: ExportTarget, export: TerrainExport) -> str:
    known = ", ".join(t.identifier for t in export.terrains)
    lines = (
        f"# {target.title}",
        f"{export.origin}.",
        f"Terrains of the database: {known}.",
        "Forces in N, velocities in m/s. Holds for the foot, the inclines and the "
        "range measured; not anisotropic.",
        *target.about(export),
    )
    return "".join(f"{' '.join(line.split())}\n" for line in lines)
