"""Folders of sessions that never began."""

import os

import pytest

from experiments.session.lock import session_lock
from experiments.session.store import create_session
from experiments.session.unbegun import remove_never_started

MINUTE = 60_000_000_000
NOW = 1_800_000_000_000_000_000


@pytest.fixture
def unbegun(tmp_path):
    """Return a session that was killed after its settings were written."""
    folder = create_session(tmp_path, "TF", is_simulated=True, utc_ns=NOW)
    (folder.path / "config.toml").write_text("")
    (folder.path / ".lock").write_text("{}")
    return folder


def age(folder, ns=2 * MINUTE):
    """Let everything in a folder be of `ns` before now."""
    for path in (*folder.path.rglob("*"), folder.path):
        os.utime(path, ns=(NOW - ns, NOW - ns))


def test_a_session_that_never_began_keeps_no_number(tmp_path, unbegun):
    age(unbegun)
    assert remove_never_started(tmp_path, NOW) == [unbegun.path.name]
    again = create_session(tmp_path, "S0", is_simulated=True, utc_ns=NOW)
    assert again.id == unbegun.id


@pytest.mark.parametrize(
    "name",
    ["events.jsonl", "session.json", "trials/T01.mcap", "rejected/T01a.json", "x.txt"],
)
def test_whatever_else_is_there_keeps_it(tmp_path, unbegun, name):
    (unbegun.path / name).write_text("")
    age(unbegun)
    assert remove_never_started(tmp_path, NOW) == []
    assert (unbegun.path / name).exists()


def test_one_that_begins_now_is_left_alone(tmp_path, unbegun):
    age(unbegun, MINUTE // 2)
    assert remove_never_started(tmp_path, NOW) == []


def test_one_that_is_open_is_left_alone(tmp_path, unbegun):
    with session_lock(unbegun):
        age(unbegun)
        assert remove_never_started(tmp_path, NOW) == []


def test_a_link_is_not_followed(tmp_path, unbegun):
    other = tmp_path / "other"
    other.mkdir()
    (other / "precious").write_text("")
    (unbegun.path / "trials").rmdir()
    (unbegun.path / "trials").symlink_to(other)
    assert remove_never_started(tmp_path, NOW) == []
    assert (other / "precious").exists()
