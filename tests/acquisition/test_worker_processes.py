"""What outlives nobody and runs no script twice: processes for tasks.

A script's output ends when the last of its processes has closed it.
"""

import signal
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
WAITING = """
import os, sys, time
from acquisition.worker_processes import run_calls
def work():
    calls = run_calls([(os.getpid,), *[(time.sleep, 600)] * 4], 2)
    print(next(calls), flush=True)
    next(calls)
try:
    work()
except KeyboardInterrupt:  # wherever it comes, even between two results
    print("interrupted", file=sys.stderr)
"""
UNGUARDED = """
import operator
from acquisition.worker_processes import run_calls
print(sorted(run_calls([(operator.mul, k, k) for k in range(5)], 2)))
"""


def started(script, *flags):
    return subprocess.Popen(
        [sys.executable, *flags, str(script)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env={"PYTHONPATH": str(ROOT)},
        text=True,
    )


@pytest.fixture
def script(tmp_path):
    return tmp_path / "script.py"


@pytest.mark.parametrize("name", ["SIGKILL", "SIGTERM", "SIGINT"])
def test_workers_end_with_their_parent_whatever_they_do(script, name):
    script.write_text(WAITING)
    with started(script) as parent:
        assert int(parent.stdout.readline()) != parent.pid
        parent.send_signal(signal.Signals[name])
        _, errors = parent.communicate()  # until the last process is gone
    assert "Traceback" not in errors
    assert errors.count("interrupted") == (name == "SIGINT")


def test_a_script_is_not_run_again_by_workers(script):
    script.write_text(UNGUARDED)
    with started(script) as parent:
        out, errors = parent.communicate()
    assert out == "[0, 1, 4, 9, 16]\n"
    assert not errors


def test_workers_take_no_module_of_the_working_folder(script, monkeypatch):
    (script.parent / "acquisition.py").write_text("raise SystemExit(3)")
    (script.parent / "other").mkdir()
    script.write_text(UNGUARDED)
    script.rename(script.parent / "other" / "script.py")
    monkeypatch.chdir(script.parent)
    with started(script.parent / "other" / "script.py") as parent:
        out, _ = parent.communicate()
    assert out == "[0, 1, 4, 9, 16]\n"
