"""Commands on a hostile session folder read and write nothing outside the folder."""

import os
import shutil
from pathlib import Path

import pytest

from acquisition.errors import TractionError
from experiments.session.data_files import sha256_of, write_json
from experiments.session.lock import session_lock
from experiments.session.store import find_session
from tests.experiments.program import only_session, traction

pytestmark = pytest.mark.slow

FILES = [
    ".lock",
    "events.jsonl",
    "session.json",
    "trials/T01.json",
    "trials/T01.mcap",
]
FOLDERS = ["trials", "rejected"]
COMMANDS = [
    ("status",),
    ("verify", "S001"),
    ("note", "S001", "T01", "seen"),
    ("verdict", "S001", "T01", "reject", "why"),
    ("resume", "S001"),
    ("export", "S001", "--to", "{}/tables"),
]


@pytest.fixture
def data(recorded, tmp_path):
    shutil.copytree(recorded.data, tmp_path / "data")
    return tmp_path / "data"


@pytest.fixture
def outside(tmp_path):
    """A folder outside the data whose files must not change."""
    (tmp_path / "outside").mkdir()
    return tmp_path / "outside"


def link(path, outside):
    """Move `path` outside and leave a symbolic link to it."""
    target = outside / path.name
    shutil.move(path, target)
    path.symlink_to(target)
    return target


def name_of(descriptor):
    return str(Path(f"/proc/self/fd/{descriptor}").readlink())


def contents(folder):
    return {p: p.read_bytes() for p in folder.rglob("*") if p.is_file()}


@pytest.mark.parametrize("name", FILES + FOLDERS)
@pytest.mark.parametrize("command", COMMANDS, ids=lambda c: c[0])
def test_nothing_is_written_through_a_link(data, config, outside, name, command):
    link(only_session(data) / name, outside)
    before = contents(outside)
    arguments = [a.format(data.parent) for a in command]
    done = traction(*arguments, "--data", data, "--config", config)
    assert contents(outside) == before
    assert "Traceback" not in done.err
    assert "bug" not in done.err


@pytest.mark.parametrize("name", FILES + FOLDERS)
def test_status_names_a_symbolic_link(data, config, outside, name):
    link(only_session(data) / name, outside)
    done = traction("status", "--data", data, "--config", config)
    assert done.code == 6
    assert f"{name} is a symbolic link" in done.err


def test_sessions_alongside_a_hostile_one_are_still_counted(data, config, outside):
    session = only_session(data)
    other = session.with_name(session.name.replace("S001", "S002"))
    shutil.copytree(session, other)
    link(session / "events.jsonl", outside)
    done = traction("status", "--data", data, "--config", config)
    assert "S002" in done.out


@pytest.mark.parametrize("name", FILES)
def test_a_pipe_is_reported_and_not_waited_for(data, config, name):
    path = only_session(data) / name
    path.unlink()
    os.mkfifo(path)
    done = traction("status", "--data", data, "--config", config)
    assert done.code == 6
    assert f"{name} is a pipe" in done.err


@pytest.mark.parametrize("name", ["events.jsonl", "trials/T01.mcap"])
def test_a_file_hard_linked_from_elsewhere_is_refused(data, outside, name):
    path = only_session(data) / name
    (outside / "other").hardlink_to(path)
    done = traction("verify", "S001", "--data", data)
    assert done.code == 6
    assert f"{name} has another name elsewhere" in done.err


def test_a_file_hard_linked_within_its_session_is_read(data):
    """A kill between two steps of a move leaves such a file."""
    path = only_session(data) / "trials" / "T01.mcap"
    (only_session(data) / "rejected" / "T01a.mcap").hardlink_to(path)
    assert len(sha256_of(path)) == 64


def test_a_temporary_file_that_is_a_link_is_not_followed(tmp_path, outside):
    (outside / "target").write_text("mine")
    (tmp_path / "session.json.tmp").symlink_to(outside / "target")
    write_json(tmp_path / "session.json", {"kept": 1})
    assert (outside / "target").read_text() == "mine"


def test_a_lock_that_is_a_link_is_refused(data, outside):
    link(only_session(data) / ".lock", outside)
    with (
        pytest.raises(TractionError, match="symbolic link"),
        session_lock(find_session(data, "S001")),
    ):
        pass


@pytest.mark.parametrize("name", ["trials/T01.json", "session.json", "events.jsonl"])
def test_a_file_beyond_its_size_limit_is_reported(data, config, name):
    os.truncate(only_session(data) / name, 3 * 2**30)  # sparse: takes no space
    done = traction("status", "--data", data, "--config", config)
    assert done.code == 6
    assert "the limit is" in done.err


@pytest.mark.parametrize(
    "content",
    [
        '{"history": 5, "notes": 7, "attempt": 1}',
        '{"attempt": NaN}',
        "[]",
        *(
            pytest.param(content, marks=pytest.mark.long)
            for content in (
                "1" * 5000,
                '{"attempt": %s}' % ("9" * 4301),
                '{"attempt": 1, "ratio": 1e999}',
            )
        ),
    ],
    ids=lambda text: text[:30],
)
def test_a_sidecar_with_wrong_values_crashes_no_command(data, config, content):
    (only_session(data) / "trials" / "T01.json").write_text(content)
    for command in COMMANDS:
        arguments = [a.format(data.parent) for a in command]
        done = traction(*arguments, "--data", data, "--config", config)
        assert done.code in (0, 2, 6), done.err


def test_a_session_json_with_wrong_values_crashes_no_command(data, config):
    text = '{"phase": [], "operator": {"a": 1}, "kept": 5, "force_drift": "x"}'
    (only_session(data) / "session.json").write_text(text)
    for command in COMMANDS:
        arguments = [a.format(data.parent) for a in command]
        done = traction(*arguments, "--data", data, "--config", config)
        assert done.code in (0, 2, 6), done.err


def test_a_journal_line_with_a_wrong_checksum_is_left_out_and_named(data):
    path = only_session(data) / "events.jsonl"
    text = path.read_text()
    path.write_text(text.replace('"trials": 2', '"trials": 3', 1))
    session = find_session(data, "S001")
    assert len(session.events()) == len(text.splitlines()) - 1
    done = traction("verify", "S001", "--data", data)
    assert done.code == 6
    assert "events.jsonl has a wrong checksum in line 1" in done.err


def test_a_journal_line_without_a_checksum_is_left_out(data):
    path = only_session(data) / "events.jsonl"
    lines = path.read_text().splitlines(keepends=True)
    lines[3] = lines[3].rpartition(', "crc"')[0] + "}\n"
    path.write_text("".join(lines))
    session = find_session(data, "S001")
    assert len(session.events()) == len(lines) - 1
    done = traction("verify", "S001", "--data", data)
    assert done.code == 6
    assert "events.jsonl has a wrong checksum in line 4" in done.err


def test_folders_of_journal_and_sidecars_are_synced_to_disk(data, monkeypatch):
    synced = set()
    usual = os.fsync

    def fsync(descriptor):
        synced.add(name_of(descriptor))
        usual(descriptor)

    monkeypatch.setattr(os, "fsync", fsync)
    assert traction("verdict", "S001", "T01", "reject", "x", "--data", data).code == 0
    session = only_session(data)
    folders = {str(session), str(session / "trials"), str(session / "rejected")}
    assert folders <= synced


def test_the_folder_of_a_new_journal_is_synced_to_disk(data, monkeypatch):
    session = find_session(data, "S001")
    (session.path / "events.jsonl").unlink()
    synced = set()
    monkeypatch.setattr(os, "fsync", lambda fd: synced.add(name_of(fd)))
    session.append_event({"event": "noted"})
    assert str(session.path) in synced
