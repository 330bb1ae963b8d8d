"""One program at a time may open an arm's bus, whatever is in place of the lock."""

import os
import signal
import stat
import subprocess
import sys

import pytest

from acquisition.errors import PreflightError
from experiments.rig.arm_lock import ArmLock, lock_folder, lock_name

HOLD = """
import sys
from pathlib import Path
from experiments.rig.arm_lock import ArmLock
lock = ArmLock("socketcan", "can7", [Path(sys.argv[1])])
print("held", flush=True)
sys.stdin.readline()
"""


@pytest.fixture
def shared(tmp_path):
    """A folder that every user may write to, like /run/lock."""
    folder = tmp_path / "lock"
    folder.mkdir()
    folder.chmod(0o1777)
    return folder


@pytest.fixture
def holder(shared):
    """Another process that holds the lock of the arm on can7."""
    process = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(shared)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout.readline() == "held\n"
    yield process
    process.kill()
    process.communicate()


def take(shared, channel="can7"):
    return ArmLock("socketcan", channel, [shared])


def test_a_second_process_is_refused_with_the_owner_of_the_arm(shared, holder):
    with pytest.raises(PreflightError) as refused:
        take(shared)
    assert refused.value.exit_code == 3
    assert f"process {holder.pid} (-c" in refused.value.message
    assert "socketcan:can7" in refused.value.message
    assert " UTC" in refused.value.message


def test_another_channel_is_another_arm(shared, holder):
    other = take(shared, "can8")
    assert "can8" in other.path.name
    other.close()
    with pytest.raises(PreflightError):
        take(shared)


def test_a_killed_owner_releases_the_arm(shared, holder):
    with pytest.raises(PreflightError):
        take(shared)
    holder.send_signal(signal.SIGKILL)
    holder.wait()
    take(shared).close()


def test_a_child_of_the_owner_does_not_keep_the_arm(shared):
    lock = take(shared)
    child = subprocess.Popen(
        [sys.executable, "-c", "import sys; sys.stdin.read()"], stdin=subprocess.PIPE
    )
    with pytest.raises(PreflightError):
        take(shared)
    lock.close()
    take(shared).close()
    assert child.poll() is None
    child.communicate()


def test_closing_releases_the_arm_and_can_be_repeated(shared):
    lock = take(shared)
    with pytest.raises(PreflightError):
        take(shared)
    lock.close()
    lock.close()
    take(shared).close()


def test_any_user_may_be_the_next_owner_whatever_the_umask(shared):
    before = os.umask(0o077)
    try:
        lock = take(shared)
    finally:
        os.umask(before)
    assert stat.S_IMODE(lock.path.stat().st_mode) == 0o666
    lock.close()


def test_a_read_only_lock_file_of_another_user_is_locked_too(shared, monkeypatch):
    take(shared).close()
    usual = os.open

    def refuse_writing(path, flags, *mode):
        if flags & os.O_RDWR:
            raise PermissionError(13, "Permission denied")
        return usual(path, flags, *mode)

    monkeypatch.setattr(os, "open", refuse_writing)
    lock = take(shared)
    with pytest.raises(PreflightError, match="in use"):
        take(shared)
    lock.close()


def test_a_link_in_place_of_the_lock_is_not_followed(shared, tmp_path):
    victim = tmp_path / "precious"
    victim.write_text("precious")
    (shared / lock_name("socketcan", "can7")).symlink_to(victim)
    with pytest.raises(PreflightError, match="cannot be the arm's lock"):
        take(shared)
    assert victim.read_text() == "precious"


def test_a_hard_link_in_place_of_the_lock_is_not_written_to(shared, tmp_path):
    victim = tmp_path / "precious"
    victim.write_text("precious")
    (shared / lock_name("socketcan", "can7")).hardlink_to(victim)
    with pytest.raises(PreflightError, match="not a regular file with a single link"):
        take(shared)
    assert victim.read_text() == "precious"


def test_a_pipe_in_place_of_the_lock_is_refused_without_waiting(shared):
    os.mkfifo(shared / lock_name("socketcan", "can7"))
    with pytest.raises(PreflightError, match="not a regular file with a single link"):
        take(shared)


@pytest.mark.parametrize("words", [b"", b"\xff{", b"[1]", b'{"pid": 1', b"[" * 1024])
def test_an_owner_with_an_unreadable_entry_is_called_another_program(shared, words):
    lock = take(shared)
    lock.path.write_bytes(words)
    with pytest.raises(PreflightError, match=r"process \? \(another program\)"):
        take(shared)
    lock.close()


def test_control_characters_of_an_owner_never_reach_the_terminal(shared):
    lock = take(shared)
    lock.path.write_text('{"pid": 1, "command": "\\u001b[2Jrun"}')
    with pytest.raises(PreflightError) as refused:
        take(shared)
    assert "(" + "[2Jrun)" in refused.value.message
    assert "\x1b" not in refused.value.message
    lock.close()


def test_the_lock_folder_is_open_to_all_users(shared, tmp_path):
    private = tmp_path / "private"
    private.mkdir()
    assert lock_folder([tmp_path / "none", private, shared]) == shared
    with pytest.raises(PreflightError, match="open to all users"):
        lock_folder([private])


@pytest.mark.parametrize(
    "channel", ["/dev/ttyACM0", "../../etc/passwd", "a b\n", "x" * 300, "\0"]
)
def test_the_lock_of_any_channel_stays_in_the_folder(channel):
    name = lock_name("slcan", channel)
    assert name == os.path.basename(name)  # noqa: PTH119
    assert name.isprintable()
    assert len(name) < 255


def test_a_served_bus_is_the_same_by_every_path(tmp_path, monkeypatch):
    (tmp_path / "link").symlink_to(tmp_path / "bus")
    monkeypatch.chdir(tmp_path)
    names = {
        lock_name("traction-fake", str(path))
        for path in (tmp_path / "bus", tmp_path / "link", "bus", "./bus")
    }
    assert len(names) == 1


def test_names_of_different_buses_differ():
    pairs = [("a", "b-c"), ("a-b", "c"), ("a:b", "c"), ("a", "b:c%3A")]
    assert len({lock_name(*pair) for pair in pairs}) == len(pairs)
