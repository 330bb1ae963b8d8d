"""Provenance of a recording: code, packages, machine."""

import platform
import shutil
import subprocess
from functools import cache
from importlib import metadata
from pathlib import Path

PACKAGES = ("traction", "numpy", "pin", "python-can", "pyserial", "mcap", "scipy")


def collect() -> dict[str, str]:
    """Return software version, commit, dirty state, packages and kernel as strings."""
    commit, diff = _git()
    versions = {
        "software": f"traction {_version('traction')}",
        "commit": commit,
        "dirty": "true" if diff else "false",
        "python": platform.python_version(),
        "kernel": f"{platform.system()} {platform.release()}",
        "machine": platform.machine(),
    }
    versions.update({f"package:{name}": _version(name) for name in PACKAGES})
    return versions


def diff_patch() -> str:
    """Return the uncommitted changes of the code, empty for none."""
    return _git()[1]


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "unknown"


@cache
def _git() -> tuple[str, str]:
    """Return commit and uncommitted changes at the first call.

    Later changes of the files do not affect the running program.
    """
    folder = Path(__file__).resolve().parent.parent
    git = shutil.which("git")
    if git is None or not (folder / ".git").exists():
        return "unknown", ""

    def ask(*words: str) -> str:
        command = [git, "-C", str(folder), *words]
        try:
            done = subprocess.run(command, capture_output=True, check=False, timeout=10)
        except (OSError, subprocess.TimeoutExpired):
            return ""
        return done.stdout.decode(errors="replace") if done.returncode == 0 else ""

    return ask("rev-parse", "HEAD").strip() or "unknown", ask("diff", "HEAD")
