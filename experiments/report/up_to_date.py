"""Check whether a report is up to date, without reading a trial."""

import hashlib
import json
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from acquisition.errors import SettingsError
from acquisition.files import read_regular
from analysis.study.store import sources_digest, write_atomic
from experiments.report.chosen_sessions import folder_of
from experiments.session.store import FOLDS, SessionFolder

_ROOT = Path(__file__).parents[2]
_PACKAGES = ("acquisition", "analysis", "experiments", "ft_sensor", "wam")
_LIBRARIES = ("numpy", "scipy", "matplotlib", "pillow", "jinja2")
_PAGE = "report/index.html"
_LARGEST = 1 << 20  # bytes of a record


@dataclass(frozen=True, slots=True)
class ReportRecord:
    """Record of the inputs of a report, stored with the results of its study.

    Attributes:
        out: folder of the report.
        path: path of the record.
        inputs: digest of sessions, options, program and libraries.
    """

    out: Path
    path: Path
    inputs: str

    @property
    def page(self) -> Path:
        """The page of the report."""
        return self.out / _PAGE

    def is_current(self) -> bool:
        """Whether the report has the same inputs and unchanged files.

        Files are compared by size and time of change; `traction verify` reads them.
        """
        try:
            kept = json.loads(read_regular(self.path, _LARGEST))
        except (OSError, ValueError):
            return False
        return self.page.is_file() and kept == self._content()

    def write(self) -> None:
        """Write the record of a new report, if possible."""
        with suppress(SettingsError):
            write_atomic(self.path, json.dumps(self._content()).encode())

    def _content(self) -> dict[str, object]:
        figures = sorted((self.out / "figures").glob("*"))
        files = [self.page, *(self.out / f"fits.{end}" for end in ("json", "csv"))]
        outputs = [[str(path), *_stamp(path)] for path in (*files, *figures)]
        return {"inputs": self.inputs, "outputs": outputs}


def record_of(
    sessions: Sequence[SessionFolder], data: Path, out: Path | None, options: str
) -> ReportRecord:
    """Return the record of a report of `sessions` as they are now.

    Args:
        sessions: sessions of the report.
        data: folder of the data.
        out: folder of the report; None = that of the session, or of the study.
        options: everything else that affects the report, as text.
    """
    digest = hashlib.sha256(f"{_program()} {options}".encode())
    for session in sessions:
        digest.update(f"\n{session.path.resolve()}".encode())
        for path in _recorded_files(session.path):
            digest.update(f"\n{path} {_stamp(path)}".encode())
    folder = folder_of(sessions, data, out)
    name = hashlib.sha256(str(folder.resolve()).encode()).hexdigest()
    path = (out or data) / FOLDS / f"report-{name}.json"
    return ReportRecord(folder, path, digest.hexdigest())


def _recorded_files(folder: Path) -> Iterable[Path]:
    """Yield the files of a session, except those of its report."""
    for path in sorted(folder.rglob("*")):
        top = path.relative_to(folder).parts[0]
        if top in {"report", "figures", "fits.json", "fits.csv"} or top[0] == ".":
            continue
        if not path.is_dir():
            yield path


def _stamp(path: Path) -> list[int]:
    """Return size [bytes] and times of change [ns] of a file; empty if missing."""
    try:
        status = path.lstat()
    except OSError:
        return []
    return [status.st_size, status.st_mtime_ns, status.st_ctime_ns]


@cache
def _program() -> str:
    """Return the digest of the program's sources and data files, and of libraries."""
    every = (p for name in _PACKAGES for p in (_ROOT / name).rglob("*"))
    files = [p for p in every if p.is_file() and p.suffix != ".pyc"]
    return sources_digest(_ROOT, files, _LIBRARIES)
