"""Folders of sessions that never started are removed, and no others."""

import os

import pytest

from experiments.session.lock import session_lock
from experiments.session.never_started import remove_never_started
from experiments.session.store import create_session

MINUTE = 60_000_000_000
NOW = 1_800_000_000_000_000_000


@pytest.fixture
def never_started(tmp_path):
    """A session that was killed after its settings were written."""
    folder = create_session(tmp_path, "TF", is_simulated=True, utc_ns=NOW)
    (folder.path / "config.toml").write_text("")
    (folder.path / ".lock").write_text("{}")
    return folder


def age(folder, ns=2 * MINUTE):
    """Set the modification times of a folder and its contents to `ns` before now."""
    for path in (*folder.path.rglob("*"), folder.path):
        os.utime(path, ns=(NOW - ns, NOW - ns))


def test_a_session_that_never_started_frees_its_number(tmp_path, never_started):
    age(never_started)
    assert remove_never_started(tmp_path, NOW) == [never_started.path.name]
    again = create_session(tmp_path, "S0", is_simulated=True, utc_ns=NOW)
    assert again.id == never_started.id


@pytest.mark.parametrize(
    "name",
    ["events.jsonl", "session.json", "trials/T01.mcap", "rejected/T01a.json", "x.txt"],
)
def test_a_session_folder_with_any_other_file_is_kept(tmp_path, never_started, name):
    (never_started.path / name).write_text("")
    age(never_started)
    assert remove_never_started(tmp_path, NOW) == []
    assert (never_started.path / name).exists()


def test_a_session_that_is_just_starting_is_kept(tmp_path, never_started):
    age(never_started, MINUTE // 2)
    assert remove_never_started(tmp_path, NOW) == []


def test_an_open_session_is_kept(tmp_path, never_started):
    with session_lock(never_started):
        age(never_started)
        assert remove_never_started(tmp_path, NOW) == []


def test_a_link_is_not_followed(tmp_path, never_started):
    other = tmp_path / "other"
    other.mkdir()
    (other / "precious").write_text("")
    (never_started.path / "trials").rmdir()
    (never_started.path / "trials").symlink_to(other)
    assert remove_never_started(tmp_path, NOW) == []
    assert (other / "precious").exists()
