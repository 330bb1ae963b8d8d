"""Temporary folders of killed processes are removed, those of living ones stay."""

import errno
import fcntl
import os
import signal
import subprocess
import sys

import pytest

from acquisition.temporary_folders import remove_abandoned, temporary_folder

HOLD = """
import sys, time
from pathlib import Path
from acquisition.temporary_folders import temporary_folder
with temporary_folder("room", Path(sys.argv[1])) as folder:
    (folder / "file").write_text("x")
    print(folder, flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def holder(tmp_path):
    """A process that holds a folder, and the folder's path."""
    process = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(tmp_path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    path = tmp_path / process.stdout.readline().strip()
    yield process, path
    process.kill()
    process.communicate()


def test_a_folder_is_removed_after_use(tmp_path):
    with temporary_folder("room", tmp_path) as folder:
        (folder / "file").write_text("x")
    assert list(tmp_path.iterdir()) == []


def test_the_folder_of_a_running_process_is_kept(holder, tmp_path):
    _, path = holder
    remove_abandoned("room", tmp_path)
    assert (path / "file").read_text() == "x"


def test_the_folder_of_a_killed_process_is_removed_by_the_next(holder, tmp_path):
    process, path = holder
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert path.exists()
    with temporary_folder("room", tmp_path):
        assert not path.exists()


def test_the_folder_of_a_zombie_process_is_removed(tmp_path):
    with subprocess.Popen([sys.executable, "-c", ""]) as process:
        os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)
        folder = tmp_path / f"room-{process.pid}-abcdefgh"
        folder.mkdir()
        with temporary_folder("room", tmp_path):
            assert not folder.exists()


def test_a_locked_folder_is_kept_though_its_process_is_unknown(tmp_path):
    path = tmp_path / f"room-{_dead_pid()}-abc"
    path.mkdir()
    descriptor = os.open(path, os.O_RDONLY)
    fcntl.flock(descriptor, fcntl.LOCK_EX)
    remove_abandoned("room", tmp_path)
    assert path.exists()
    os.close(descriptor)
    remove_abandoned("room", tmp_path)
    assert not path.exists()


def test_without_file_locks_no_folder_is_removed(tmp_path, monkeypatch):
    def flock(*_):
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    path = tmp_path / f"room-{_dead_pid()}-abc"
    path.mkdir()
    monkeypatch.setattr(fcntl, "flock", flock)
    with temporary_folder("room", tmp_path) as own:
        assert own.is_dir()
    assert path.exists()


@pytest.mark.parametrize("name", ["room-x-abc", "room-1", "other-{pid}-abc"])
def test_folders_of_other_names_are_kept(tmp_path, name):
    path = tmp_path / name.format(pid=_dead_pid())
    path.mkdir()
    remove_abandoned("room", tmp_path)
    assert path.exists()


def test_a_link_is_not_followed(tmp_path):
    outside = tmp_path / "outside"
    outside.mkdir()
    (tmp_path / f"room-{_dead_pid()}-abc").symlink_to(outside)
    remove_abandoned("room", tmp_path)
    assert outside.exists()


def _dead_pid():
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()
    return process.pid
