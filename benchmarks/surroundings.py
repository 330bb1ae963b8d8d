"""The machine and software versions of a measurement."""

import datetime
import importlib.metadata
import os
import platform
import subprocess
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).parents[1]


def surroundings(libraries: Iterable[str] = ()) -> str:
    """Return commit, machine, date and versions in one paragraph."""
    commit = subprocess.run(
        ["git", "describe", "--always", "--dirty", "--abbrev=10"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    ).stdout.strip()
    today = datetime.datetime.now(datetime.UTC).date()
    load = os.getloadavg()[0]
    machine = (
        f"Commit {commit or 'unknown'}, {today}, Python {platform.python_version()}, "
        f"{len(os.sched_getaffinity(0))} cores ({processor()}), load {load:.1f} at the "
        "end."
    )
    versions = ", ".join(map(version_of, libraries))
    return f"{machine} {versions}." if versions else machine


def processor() -> str:
    """Return the name of the processor."""
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            return line.partition(":")[2].strip()
    return platform.machine()


def version_of(name: str) -> str:
    """Return a library's name and version."""
    try:
        return f"{name} {importlib.metadata.version(name)}"
    except importlib.metadata.PackageNotFoundError:
        return f"{name} not installed"
