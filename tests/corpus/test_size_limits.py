"""The whole program refuses oversized files without much memory.

Sparse files take no disk; the memory of a command is read from the kernel.
"""

import os
import subprocess
import sys
import zipfile
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.corpus.used_session import lay_out

pytestmark = [pytest.mark.slow, pytest.mark.timeout(180)]
ROOT = Path(__file__).parents[2]
MEMORY = 300 * 2**20
# A process writes its peak memory at exit: the value that the kernel reports to the
# parent is never below the parent's own peak.
PEAK = """import atexit, os, re, sys

def peak():
    with open("/proc/self/status") as status, open(os.environ["PEAK"], "w") as out:
        out.write(re.search(r"VmHWM:\\s+(\\d+)", status.read())[1])

atexit.register(peak)
"""
START = PEAK + "from experiments.__main__ import main; sys.exit(main())"
READ = (
    PEAK
    + """from pathlib import Path
from analysis.tables.loading import load_tables
(trials,) = load_tables([Path(sys.argv[1])]).values()
print(len(trials[0].t))
"""
)
SESSION_FILES = ("T01.json", "session.json", "events.jsonl", "trials/T01.mcap", ".lock")
COMMANDS = (
    ("status",),
    ("verify", "--all"),
    ("note", "S001", "T01", "seen"),
    ("verdict", "S001", "T01", "reject", "why"),
    ("report", "S001"),
)


@dataclass(frozen=True)
class CommandResult:
    """Exit code, output and peak memory [bytes] of a command."""

    code: int
    text: str
    memory: int


def run(*arguments, cwd, code=START):
    """Run `traction`, or other code, in its own process."""
    log, peak = cwd / "out.txt", cwd / "peak.txt"
    more = {"OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": str(ROOT), "PEAK": str(peak)}
    with log.open("w") as out:
        done = subprocess.run(
            [sys.executable, "-c", code, *map(str, arguments)],
            cwd=cwd,
            stdout=out,
            stderr=out,
            env={**os.environ, **more},
            check=False,
        )
    return CommandResult(done.returncode, log.read_text(), int(peak.read_text()) * 1024)


def sparse(path, size):
    """Extend `path` to `size` bytes without using disk space."""
    with path.open("ab") as file:
        file.truncate(size)


@pytest.fixture
def data(tmp_path):
    return lay_out(tmp_path / "data")


@pytest.mark.parametrize("name", SESSION_FILES)
def test_an_oversized_session_file_is_not_read(data, name):
    path = next(p for p in data.rglob("*") if str(p).endswith(name))
    sparse(path, 3 * 2**30)
    for command in COMMANDS:
        result = run(*command, "--data", data, cwd=data.parent)
        assert result.code in {0, 2, 6}, result.text
        assert result.memory < MEMORY, (command, result)


def test_an_oversized_partial_file_is_not_recovered(data):
    path = next(data.rglob("trials")) / "T03.mcap.partial"
    path.touch()
    sparse(path, 3 * 2**30)
    result = run("recover", path, cwd=data.parent)
    assert result.code == 6
    assert "the limit is 67108864" in result.text
    assert result.memory < MEMORY


def write_bomb(path):
    """Write 1.8 GB of zeros into an npz of 8 MB at most."""
    zeros = bytes(60_000_000)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for number in range(30):
            archive.writestr(f"TF/{number:02d}.npy", zeros)


def lines(text, size):
    return text * (size // len(text))


HEADER = b"t,v_t,F_n,F_t\n"
TABLES = {
    "320-mb.csv": lambda path: sparse(path, 320_000_000),
    "one-line.csv": lambda path: path.write_bytes(HEADER + lines(b"1,", 23_000_000)),
    "one-header.csv": lambda path: path.write_bytes(lines(b"t,", 23_000_000)),
    "bomb.npz": write_bomb,
}


@pytest.mark.parametrize("name", TABLES)
def test_a_table_beyond_its_limits_is_refused(tmp_path, name):
    TABLES[name](tmp_path / name)
    result = run("fit", tmp_path / name, "--to", tmp_path / "out", cwd=tmp_path)
    assert result.code == 2, result.text
    assert result.memory < MEMORY, result


def test_the_largest_table_is_read_within_the_memory_limit(tmp_path):
    path = tmp_path / "large.csv"
    count = 950_000
    rows = (b"%d.25,0.125,2.5,1.5\n" % number for number in range(count))
    path.write_bytes(b"t [s],v_t,F_n,F_t\n" + b"".join(rows))
    assert 22_000_000 < path.stat().st_size < 24_000_000
    result = run(path, cwd=tmp_path, code=READ)
    assert result.text.split() == [str(count)]
    assert result.memory < MEMORY


DATABASES = {
    "sparse": lambda path: sparse(path, 3 * 2**30),
    "lists": lambda path: path.write_bytes(
        b"[" + lines(b"[],", 5_900_000).rstrip(b",") + b"]"
    ),
}


@pytest.mark.parametrize("name", DATABASES)
def test_a_database_beyond_its_limits_is_refused(tmp_path, name):
    table = tmp_path / "table.csv"
    table.write_bytes(HEADER + b"0,0.1,2,1\n" * 200)
    DATABASES[name](tmp_path / "terrains.json")
    database = ("--terrain-db", tmp_path / "terrains.json")
    result = run("identify", table, *database, cwd=tmp_path)
    assert result.code == 2, result.text
    assert result.memory < MEMORY, result


def test_a_journal_with_too_many_events_is_refused(data):
    path = next(data.rglob("events.jsonl"))
    path.write_bytes(b"{}\n" * (4 * 2**20 // 3))
    result = run("verify", "--all", "--data", data, cwd=data.parent)
    assert result.code == 6
    assert "more than 50000 lines" in result.text
    assert result.memory < MEMORY


def test_oversized_settings_are_not_read(tmp_path):
    sparse(tmp_path / "rig.toml", 3 * 2**30)
    result = run("status", "--config", tmp_path / "rig.toml", cwd=tmp_path)
    assert result.code == 2
    assert result.memory < MEMORY
