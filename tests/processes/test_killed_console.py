"""A console killed in a trial leaves a closed file, and no process or folder."""

import os
import signal
import tempfile
from pathlib import Path

import pytest

from acquisition.control_loop.faults import Fault
from acquisition.trial_file.reader import TrialReader
from acquisition.trial_file.verify import verify_file
from experiments.session.data_files import read_json
from experiments.session.store import list_sessions
from experiments.session.unfinished import find_unfinished
from tests.experiments.program import traction
from tests.processes.watching import (
    is_running,
    judged,
    running_trial,
    session,
    until,
    wait,
)

pytestmark = [pytest.mark.wall_clock, pytest.mark.timeout(240)]
STALLS = {Fault.FT_STALE, Fault.LOOP_LATE, Fault.CAN_SILENCE}  # ends of a trial


def all_gone(seen):
    pids = [seen.process.pid, *seen.pids.values()]
    return until(lambda: not any(is_running(pid) for pid in pids), 20)


def rooms(pid):
    """Folders in which process `pid` serves a simulated rig."""
    return list(Path(tempfile.gettempdir()).glob(f"traction-{pid}-*"))


@pytest.fixture(scope="module")
def killed(tmp_path_factory):
    """Data and pids of a session whose console was killed in its trial."""
    return judged(tmp_path_factory.mktemp("killed"), killed_once)


def killed_once(data):
    """The session; None if a stall of the machine ended the trial."""
    with session(data) as seen:
        if not seen.wait_for_trial():
            return None
        wait(1.0)
        if seen.has_trial_ended():
            return None
        seen.kill("console")
        assert all_gone(seen), "a process was left behind"
    return None if stop_reason(data) in STALLS else seen


def stop_reason(data):
    """Stop reason of the trial that the recorder closed."""
    (folder,) = list_sessions(data)
    return TrialReader(folder.trials / "T01.mcap").metadata["result"]["stop_reason"]


def test_the_recorder_closes_the_file_of_a_killed_console(killed):
    (folder,) = list_sessions(killed.data)
    path = folder.trials / "T01.mcap"
    assert verify_file(path).duration > 1.0
    assert stop_reason(killed.data) == "console lost"
    assert not list(folder.path.rglob("*.partial"))


def test_no_folder_of_the_simulated_rig_is_left(killed):
    assert rooms(killed.pids["fake rig"]) == []


def test_the_trial_is_rejected_whole_when_the_session_is_reopened(killed):
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
