"""Stalls of the machine: a witness, and the repetition of tests that met a stall."""

import os
import subprocess
import sys
import tempfile
from contextlib import contextmanager
from pathlib import Path

import pytest

from acquisition.clock import SystemClock

CLOCK = SystemClock()
RERUNS = 3  # of a test on the wall clock that failed during a stall
WITNESS = """import sys, time
while True:
    start = time.monotonic_ns()
    time.sleep(0.001)
    end = time.monotonic_ns()
    if end - start > float(sys.argv[1]) * 1e6:
        print(end, flush=True)
"""
STALL = 6.0  # ms, of a sleep of 1 ms: three cycles


class StallWitness:
    """A program on every core that only sleeps, and so shows stalls of the machine.

    The simulated devices share the machine with the loop. During a stall the guard
    stops the arm, which is right, but not what a test checks.
    """

    def __init__(self, folder):
        folder.mkdir(parents=True, exist_ok=True)
        self._paths = []  # a file for each core: two writers of one file tear its lines
        self._processes = [
            self._watch(core, folder / f"stalls-{core}.txt")
            for core in os.sched_getaffinity(0)
        ]

    def _watch(self, core, path):
        command = [sys.executable, "-c", WITNESS, str(STALL)]
        with path.open("w") as out:
            process = subprocess.Popen(command, stdout=out)
        os.sched_setaffinity(process.pid, {core})
        self._paths.append(path)
        return process

    def stalls_since(self, t_ns):
        """Number of stalls of any core since `t_ns` [monotonic ns]."""
        return sum(
            int(line) > t_ns
            for path in self._paths
            for line in path.read_text().splitlines(keepends=True)
            if line.strip() and line.endswith("\n")  # not one that is being written
        )

    def close(self):
        for process in self._processes:
            process.kill()
            process.wait()


@contextmanager
def stall_witness(folder):
    """A witness of stalls of the machine."""
    witness = StallWitness(folder)
    try:
        yield witness
    finally:
        witness.close()


class WallClock:
    """Repeats a test on the wall clock that failed while the machine stalled.

    A stall may end any wait of such a test, and break any claim about a time. A test
    that fails without a stall, or every time, fails.
    """

    def __init__(self):
        self._folder = None
        self._witness = None
        self._start_ns = 0

    def pytest_collection_modifyitems(self, items):
        """Mark the tests on the wall clock for repetition after a stall."""
        for item in items:
            if item.get_closest_marker("wall_clock"):
                again = pytest.mark.flaky(reruns=RERUNS, condition=self.has_stalled)
                item.add_marker(again)

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_setup(self, item):
        """Watch from before the first fixture of each attempt."""
        if item.get_closest_marker("wall_clock"):
            if self._witness is None:
                self._folder = tempfile.TemporaryDirectory()
                self._witness = StallWitness(Path(self._folder.name))
            self._start_ns = CLOCK.now_ns()

    def has_stalled(self):
        """Whether the machine stalled since the attempt began."""
        return self._witness is not None and bool(
            self._witness.stalls_since(self._start_ns)
        )

    def pytest_unconfigure(self):
        """End the witness."""
        if self._witness is not None:
            self._witness.close()
            self._folder.cleanup()
