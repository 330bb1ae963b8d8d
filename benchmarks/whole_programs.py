"""What a user waits for: the demo, its report a second time, a study of 80 trials.

    python -m benchmarks.whole_programs

The program runs as from a shell, each command in a process of its own, two at once
where two cores are there. The second report finds its fits in the store of results.
"""

import ctypes
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.rows import BenchRow

TRIALS = Path(__file__).parents[2] / "shared" / "data" / "rehearsal_trials.npz"
_TERRAINS = ("S0", "TF")
_SUBREAPER = 36  # of prctl(2)
# goals; that of a study is for a search by SciPy
_DEMO_S, _AGAIN_S, _STUDY_S = 30.0, 4.0, 100.0


def started(*arguments: str) -> subprocess.Popen[bytes]:
    """Return the program, started with these arguments and a silent terminal."""
    command = [sys.executable, "-m", "traction", *arguments]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL)


def ended(*programs: subprocess.Popen[bytes]) -> None:
    """Wait for programs.

    Raises:
        CalledProcessError: one of them failed.
    """
    for program in programs:
        if code := program.wait():
            raise subprocess.CalledProcessError(code, program.args)


def spent() -> float:
    """Return the processor time of all programs that have ended so far [s].

    Processes that a program has left to end by themselves are waited for and count.
    """
    while True:
        try:
            os.waitpid(-1, 0)
        except ChildProcessError:
            break
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def demo_rows(folder: Path) -> list[BenchRow]:
    """Return what `make demo` takes once installed, and its report again."""
    where = ("--data", str(folder))
    begin = time.perf_counter()
    ended(*(started("run", row, "--fake", "--fast", *where) for row in _TERRAINS))
    recorded = time.perf_counter()
    ended(started("report", "--all", *where))
    whole, recording = time.perf_counter() - begin, recorded - begin
    before = spent()
    ended(started("report", "--all", *where))
    return [
        BenchRow(
            "two sessions of ten trials side by side and their report, wall time",
            whole,
            "s",
            _DEMO_S,
            note=f"sessions {recording:.0f} s, report {whole - recording:.0f} s",
        ),
        BenchRow(
            "the report of 20 trials again, results kept",
            spent() - before,
            "s",
            _AGAIN_S,
        ),
    ]


def study_row(folder: Path) -> BenchRow:
    """Return what fits and figures of 80 trials on 8 terrains take."""
    what = "80 trials on 8 terrains: all fits, figures and page, wall time"
    if not TRIALS.exists():
        return BenchRow(what, None, "s", _STUDY_S, note="its trials are not there")
    begin, before = time.perf_counter(), spent()
    ended(started("fit", str(TRIALS), "--to", str(folder)))
    wall = time.perf_counter() - begin
    used = f"{spent() - before:.0f} s of processor time"
    return BenchRow(what, wall, "s", _STUDY_S, note=used)


def rows() -> list[BenchRow]:
    """Return what was measured, for the table."""
    ctypes.CDLL(None).prctl(_SUBREAPER, 1)  # their processes become ours
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        return [*demo_rows(root / "demo"), study_row(root / "study")]


if __name__ == "__main__":
    for line in rows():
        print("  ".join(line.cells()))
