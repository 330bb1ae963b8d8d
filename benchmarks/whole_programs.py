"""Duration of whole programs: the demo, a repeated report, a study of 80 trials.

    python -m benchmarks.whole_programs

Each command runs in its own process, as from a shell; the two sessions run
concurrently. The second report takes its fits from the result store.
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
_SUBREAPER = 36  # PR_SET_CHILD_SUBREAPER of prctl(2)
# Goals [s]; that of the study assumes SciPy's optimiser.
_DEMO_GOAL_S, _REPEAT_GOAL_S, _STUDY_GOAL_S = 30.0, 4.0, 100.0


def start(*arguments: str) -> subprocess.Popen[bytes]:
    """Start the program with these arguments, its output discarded."""
    command = [sys.executable, "-m", "traction", *arguments]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL)


def wait_for(*programs: subprocess.Popen[bytes]) -> None:
    """Wait for programs to end.

    Raises:
        CalledProcessError: one of them failed.
    """
    for program in programs:
        if code := program.wait():
            raise subprocess.CalledProcessError(code, program.args)


def cpu_time() -> float:
    """Return the processor time of all finished programs [s].

    Processes that a program left running are awaited and included.
    """
    while True:
        try:
            os.waitpid(-1, 0)
        except ChildProcessError:
            break
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def demo_rows(folder: Path) -> list[BenchRow]:
    """Return the times of the demo without installation and of a second report."""
    data = ("--data", str(folder))
    begin = time.perf_counter()
    wait_for(*(start("run", row, "--fake", "--fast", *data) for row in _TERRAINS))
    recorded = time.perf_counter()
    wait_for(start("report", "--all", *data))
    whole, recording = time.perf_counter() - begin, recorded - begin
    before = cpu_time()
    wait_for(start("report", "--all", *data))
    return [
        BenchRow(
            "two concurrent sessions of ten trials and their report, wall time",
            whole,
            "s",
            _DEMO_GOAL_S,
            note=f"sessions {recording:.0f} s, report {whole - recording:.0f} s",
        ),
        BenchRow(
            "repeated report of 20 trials, results stored, processor time",
            cpu_time() - before,
            "s",
            _REPEAT_GOAL_S,
        ),
    ]


def study_row(folder: Path) -> BenchRow:
    """Return the duration of the fits and figures of 80 trials on 8 terrains."""
    what = "80 trials on 8 terrains: all fits, figures and page, wall time"
    if not TRIALS.exists():
        return BenchRow(what, None, "s", _STUDY_GOAL_S, note="trials not found")
    begin, before = time.perf_counter(), cpu_time()
    wait_for(start("fit", str(TRIALS), "--to", str(folder)))
    wall = time.perf_counter() - begin
    used = f"{cpu_time() - before:.0f} s of processor time"
    return BenchRow(what, wall, "s", _STUDY_GOAL_S, note=used)


def rows() -> list[BenchRow]:
    """Return the measurements as table rows."""
    ctypes.CDLL(None).prctl(_SUBREAPER, 1)  # adopt processes left running
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        return [*demo_rows(root / "demo"), study_row(root / "study")]


if __name__ == "__main__":
    for line in rows():
        print("  ".join(line.cells()))
