"""The console is killed in a trial: the file is ended, nothing is left behind."""

import os
import signal
import tempfile
from pathlib import Path

import pytest

from acquisition.trial_file import TrialReader, verify_file
from experiments.session import find_unfinished, list_sessions, read_json
from tests.experiments.program import traction
from tests.processes.watching import is_running, running_trial, session, until

pytestmark = [pytest.mark.wall_clock, pytest.mark.timeout(240)]


def all_gone(seen):
    pids = [seen.process.pid, *seen.pids.values()]
    return until(lambda: not any(is_running(pid) for pid in pids), 20)


def rooms(pid):
    """Return the folders in which process `pid` serves a simulated rig."""
    return list(Path(tempfile.gettempdir()).glob(f"traction-{pid}-*"))


@pytest.fixture(scope="module")
def killed(tmp_path_factory):
    """Return data and pids of a session whose console was killed in its trial."""
    with running_trial(tmp_path_factory.mktemp("killed")) as seen:
        seen.kill("console")
        assert all_gone(seen), "a process was left behind"
    return seen


def test_the_recorder_ends_the_file_of_a_killed_console(killed):
    (folder,) = list_sessions(killed.data)
    path = folder.trials / "T01.mcap"
    assert verify_file(path).duration > 1.0
    assert TrialReader(path).metadata["result"]["stop_reason"] == "console lost"
    assert not list(folder.path.rglob("*.partial"))


def test_no_folder_of_the_simulated_rig_is_left(killed):
    assert rooms(killed.pids["fake rig"]) == []


def test_the_trial_is_put_away_whole_when_the_session_is_opened_again(killed):
    (unfinished,) = find_unfinished(killed.data)
    assert unfinished.seconds > 1.0
    done = traction("note", "S001", "the console was killed", "--data", killed.data)
    assert done.code == 0, done.err
    rejected = unfinished.folder.rejected
    sidecar = read_json(rejected / "T01a.json")
    assert sidecar["status"] == "interrupted"
    assert sidecar["sha256"] == verify_file(rejected / "T01a.mcap").sha256
    names = {path.name for path in unfinished.folder.path.rglob("*")}
    assert not [name for name in names if name.endswith((".partial", ".tmp"))]
    assert not [name for name in names if name.startswith(".recover")]


def test_a_killed_rig_leaves_its_folder_only_until_the_next_start(tmp_path):
    with running_trial(tmp_path / "first") as seen:
        pid = seen.pids["fake rig"]
        os.kill(pid, signal.SIGKILL)
        assert until(lambda: not is_running(pid), 10)
    assert rooms(pid)
    with session(tmp_path / "second"):
        assert until(lambda: not rooms(pid), 40)
