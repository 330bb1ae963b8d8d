"""Nothing is derived from a damaged journal, and nothing left out in silence."""

import hashlib
import shutil

import pytest

from tests.experiments.program import only_session, traction

DAMAGES = {
    "empty": lambda text: b"",
    "random": lambda text: bytes(range(256)) * 8,
    "no-start": lambda text: b"garbage\n" + text.split(b"\n", 1)[1],
    "cut": lambda text: b"\n".join(text.split(b"\n")[:-4]) + b"\n",
    "one-line": lambda text: text.split(b"\n", 1)[0] + b"\n",
    "middle": lambda text: _with_line(text, 5, b"garbage"),
}


def _with_line(text, number, line):
    lines = text.split(b"\n")
    lines[number] = line
    return b"\n".join(lines)


def contents(folder):
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in folder.rglob("*")
        if path.is_file() and path.name != ".lock"
    }


@pytest.fixture
def session(recorded, tmp_path):
    """A copy of a session with two kept trials."""
    shutil.copytree(recorded.data, tmp_path / "data")
    return only_session(tmp_path / "data")


@pytest.fixture(params=DAMAGES)
def damaged(request, session):
    """The same with a damaged journal."""
    journal = session / "events.jsonl"
    journal.write_bytes(DAMAGES[request.param](journal.read_bytes()))
    return session


@pytest.mark.parametrize(
    "command",
    [("note", "S001", "wet"), ("verdict", "S001", "T01", "reject", "wet")],
    ids=lambda words: words[0],
)
def test_nothing_is_written_to_a_session_with_a_damaged_journal(damaged, command):
    before = contents(damaged)
    done = traction(*command, "--data", damaged.parents[1])
    assert done.code == 6
    assert "Not as in the journal: S001 " in done.err
    assert "Nothing was written." in done.err
    assert contents(damaged) == before


@pytest.mark.parametrize(
    "command",
    [
        ("report", "--all", "--to"),
        ("publish", "--all", "--author", "A, B", "--licence", "CC0-1.0", "--to"),
        ("export", "--terrain-db"),
    ],
    ids=lambda words: words[0],
)
def test_a_session_with_a_damaged_journal_is_not_left_out(damaged, command, tmp_path):
    done = traction(*command, tmp_path / "out", "--data", damaged.parents[1])
    assert done.code == 6
    assert "Not as in the journal: S001 " in done.err


def test_a_copied_session_gets_no_note_and_stays_a_copy(session):
    data = session.parents[1]
    copy = session.with_name(session.name.replace("S001", "S002"))
    shutil.copytree(session, copy)
    done = traction("note", "S002", "wet", "--data", data)
    assert done.code == 6
    assert "is of S001: a copy" in done.err
    assert traction("verify", "--all", "--data", data).code == 6


def test_rejecting_a_lost_recording_says_that_it_is_lost(session):
    data = session.parents[1]
    (session / "trials" / "T01.mcap").unlink()
    done = traction("verdict", "S001", "T01", "reject", "lost", "--data", data)
    assert done.code == 0
    assert "▲ T01.mcap is missing or is not what was recorded." in done.out
