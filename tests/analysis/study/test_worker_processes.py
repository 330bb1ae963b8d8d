"""Worker processes end with their parent and do not run its script again.

A script's output ends when the last of its processes has closed it.
"""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[3]
WAITING = """
import sys, time
from analysis.study.tasks import run_tasks
try:
    run_tasks(time.sleep, [0.0, *[600.0] * 4], 2, lambda *_: print("busy", flush=True))
except KeyboardInterrupt:
    print("interrupted", file=sys.stderr)
"""
STARTING = """
import signal, sys
from analysis.study.worker_processes import warm_workers
warm_workers(["scipy.stats", "matplotlib.pyplot"])
try:
    print("busy", flush=True)
    signal.pause()
except KeyboardInterrupt:
    print("interrupted", file=sys.stderr)
"""
UNGUARDED = """
from analysis.study.tasks import run_tasks
print(run_tasks(abs, [-1, -2, -3, -4, -5], 2))
"""


def started(script, *flags):
    return subprocess.Popen(
        [sys.executable, *flags, str(script)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env={"PYTHONPATH": str(ROOT)},
        text=True,
        start_new_session=True,
    )


@pytest.fixture
def script(tmp_path):
    return tmp_path / "script.py"


@pytest.mark.parametrize("name", ["SIGKILL", "SIGTERM", "SIGINT"])
def test_workers_always_end_with_their_parent(script, name):
    script.write_text(WAITING)
    with started(script) as parent:
        assert parent.stdout.readline() == "busy\n"
        parent.send_signal(signal.Signals[name])
        _, errors = parent.communicate()  # until the last process is gone
    assert "Traceback" not in errors
    assert errors.count("interrupted") == (name == "SIGINT")


@pytest.mark.parametrize("script_text", [WAITING, STARTING])
def test_an_interrupt_key_reaches_only_the_parent(script, script_text):
    script.write_text(script_text)
    with started(script) as parent:
        assert parent.stdout.readline() == "busy\n"
        os.killpg(parent.pid, signal.SIGINT)  # as a terminal does, to all of them
        _, errors = parent.communicate()
    assert errors == "interrupted\n"


def test_a_script_is_not_run_again_by_workers(script):
    script.write_text(UNGUARDED)
    with started(script) as parent:
        out, errors = parent.communicate()
    assert out == "[1, 2, 3, 4, 5]\n"
    assert not errors


def test_workers_take_no_module_of_the_working_folder(script, monkeypatch):
    for name in ("acquisition", "joblib", "multiprocessing", "numpy", "pickle"):
        (script.parent / f"{name}.py").write_text("raise SystemExit(3)")
    (script.parent / "other").mkdir()
    script.write_text(UNGUARDED)
    script.rename(script.parent / "other" / "script.py")
    monkeypatch.chdir(script.parent)
    with started(script.parent / "other" / "script.py") as parent:
        out, errors = parent.communicate()
    assert out == "[1, 2, 3, 4, 5]\n"
    assert not errors
