"""Check whether a report is up to date, without reading a trial."""

import hashlib
import json
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path

from acquisition.files import read_regular
from analysis.study.store import write_atomic
from experiments.session.store import FOLDS, SessionFolder

_ROOT = Path(__file__).parents[2]
_PACKAGES = ("acquisition", "analysis", "experiments", "ft_sensor", "wam")
_LIBRARIES = ("numpy", "scipy", "matplotlib", "pillow", "jinja2")
_OUTPUTS = ("fits.json", "fits.csv", "report/index.html")
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
        return self.out / _OUTPUTS[-1]

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
        with suppress(OSError, ValueError):
            write_atomic(self.path, json.dumps(self._content()).encode())

    def _content(self) -> dict[str, object]:
        outputs = [_stamp(self.out / name) for name in _OUTPUTS]
        return {"inputs": self.inputs, "outputs": outputs}


def record_of(
    sessions: Sequence[SessionFolder], kept: Path, out: Path, options: object
) -> ReportRecord:
    """Return the record of a report of `sessions` in their present state.

    Args:
        sessions: the reported sessions.
        kept: folder of the stored results.
        out: folder of the report.
        options: all other inputs of the report, compared as text.
    """
    digest = hashlib.sha256(f"{_program()} {options!r}".encode())
    for session in sessions:
        digest.update(f"\n{session.path.resolve()}".encode())
        for path in _recorded_files(session.path):
            digest.update(f"\n{path} {_stamp(path)}".encode())
    name = hashlib.sha256(str(out.resolve()).encode()).hexdigest()
    return ReportRecord(out, kept / FOLDS / f"report-{name}.json", digest.hexdigest())


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
    """Return the digest of all sources, data files and libraries of the program."""
    digest = hashlib.sha256(" ".join(map(version, _LIBRARIES)).encode())
    for package in _PACKAGES:
        for path in sorted((_ROOT / package).rglob("*")):
            if path.is_file() and path.suffix not in {".pyc", ".so"}:
                digest.update(f"{path.relative_to(_ROOT)} ".encode())
                digest.update(path.read_bytes())
    return digest.hexdigest()
