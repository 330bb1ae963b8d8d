"""Support bundle: a ZIP archive of a session's small files and flight records.

It also has the files that the user names, e.g. a log of the bus, and bundle.json: the
versions of the program and its libraries, checksums, and omissions with reasons. Names
and notes of persons are included.
"""

import hashlib
import io
import json
import zipfile
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from acquisition.clock import SystemClock
from acquisition.files import UnfitFileError, read_regular
from experiments import provenance
from experiments.session.data_files import write_new
from experiments.session.store import JOURNAL_FILE, SessionFolder, iso_utc

MANIFEST = "bundle.json"
LARGEST = 64_000_000  # bytes of one file
MOST = 200_000_000  # bytes of all files
_OF_SESSION = (
    "session.json",
    JOURNAL_FILE,
    "preflight.json",
    "provenance.json",
    "conditions.json",
    "config.toml",
    "matrix.toml",
    "diff.patch",
    "log.txt",
)


@dataclass(slots=True)
class BundleContents:
    """Content of a bundle.

    Attributes:
        files: content by file name.
        left_out: reasons of omissions by file name.
    """

    files: dict[str, bytes] = field(default_factory=dict[str, bytes])
    left_out: dict[str, str] = field(default_factory=dict[str, str])

    def add(self, name: str, path: Path) -> None:
        """Add a file, or note why it is omitted; a missing one is skipped."""
        room = min(LARGEST, MOST - sum(map(len, self.files.values())))
        try:
            self.files[name] = read_regular(path, room, is_link_followed=False)
        except FileNotFoundError:
            return
        except UnfitFileError as error:
            self.left_out[name] = str(error)
        except OSError as error:
            self.left_out[name] = error.strerror or str(error)


def write_bundle(
    folder: SessionFolder, to: Path, others: Iterable[Path]
) -> BundleContents:
    """Write the bundle of a session to `to`, a new file; returns its content.

    Args:
        folder: the session.
        to: the archive.
        others: further files, e.g. a log of the bus.

    Raises:
        TrialFileError: `to` exists, or the disk is full or unavailable.
    """
    contents = BundleContents()
    for name in _OF_SESSION:
        contents.add(name, folder.path / name)
    for part, pattern in (
        ("trials", "T*.json"),
        ("rejected", "T*.json"),
        ("faults", "*.mcap"),
    ):
        for path in sorted((folder.path / part).glob(pattern)):
            contents.add(f"{part}/{path.name}", path)
    for number, path in enumerate(others, 1):
        contents.add(f"others/{number}_{path.name}", path.resolve())
    write_new(to, _archive({MANIFEST: _manifest(folder, contents), **contents.files}))
    return contents


def _manifest(folder: SessionFolder, contents: BundleContents) -> bytes:
    content = {
        "schema": 1,
        "session": folder.id,
        "terrain": folder.terrain,
        "simulated": folder.is_simulated,
        "made_utc": iso_utc(SystemClock().utc_ns()),
        "versions": provenance.collect(),
        "files": [
            {
                "name": name,
                "size": len(data),
                "sha256": hashlib.sha256(data).hexdigest(),
            }
            for name, data in contents.files.items()
        ],
        "left_out": contents.left_out,
    }
    return json.dumps(content, indent=1).encode()


def _archive(files: dict[str, bytes]) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    return buffer.getvalue()
