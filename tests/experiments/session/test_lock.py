import os
import signal

import pytest

from acquisition.errors import SessionError
from experiments.operator.console import Console
from experiments.run.resume import ResumeRequest, close, redo, resume_session
from experiments.session.annotations import add_note, change_verdict
from experiments.session.lock import owner_of, session_lock
from experiments.session.store import create_session
from tests.experiments.program import traction
from tests.experiments.session.test_unfinished import START


@pytest.fixture
def folder(tmp_path):
    return create_session(tmp_path, "S0", is_simulated=True, utc_ns=10**18)


def hold_elsewhere(folder):
    """Process that holds the lock until it is killed."""
    ready, locked = os.pipe()
    child = os.fork()
    if child == 0:
        with session_lock(folder):
            os.write(locked, b"!")
            signal.pause()
        os._exit(0)
    os.read(ready, 1)
    os.close(ready)
    os.close(locked)
    return child


def end(child):
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)


def test_a_session_is_open_in_one_process_only(folder, tmp_path):
    child = hold_elsewhere(folder)
    try:
        owner = owner_of(folder)
        done = traction("note", "S001", "hello", "--data", tmp_path)
    finally:
        end(child)
    assert owner.pid == child
    assert done.code == 2
    assert done.err == (
        f"S001 is open in process {child} since {owner.since} UTC. "
        "To watch: traction status --follow\n"
    )


def test_the_lock_of_a_dead_process_is_taken_over(folder):
    child = hold_elsewhere(folder)
    assert owner_of(folder) is not None
    end(child)
    assert owner_of(folder) is None
    with session_lock(folder):
        assert owner_of(folder).pid == os.getpid()
    assert owner_of(folder) is None


def test_a_lock_is_not_taken_twice_in_one_process(folder):
    with (
        session_lock(folder),
        pytest.raises(SessionError, match="is open in"),
        session_lock(folder),
    ):
        pytest.fail("two have it")


CHANGES = {
    "note": lambda folder, _: add_note(folder, "", "hello", "Ada"),
    "verdict": lambda folder, _: change_verdict(folder, "T01", "reject", "why", "Ada"),
    "close": lambda folder, request: close(folder, "why", request.console),
    "resume": resume_session,
    "redo": lambda folder, request: redo(folder, 1, "why", request),
}


@pytest.mark.parametrize("name", CHANGES)
def test_a_session_open_elsewhere_is_not_changed(folder, tmp_path, name):
    folder.append_event(START)
    before = folder.journal_text()
    request = ResumeRequest(tmp_path, None, Console(color=False), is_fake=True)
    with session_lock(folder), pytest.raises(SessionError, match="is open in"):
        CHANGES[name](folder, request)
    assert folder.journal_text() == before


def test_a_damaged_lock_file_does_not_block_a_session(folder):
    (folder.path / ".lock").write_bytes(b"\xff[")
    with session_lock(folder):
        assert owner_of(folder).pid == os.getpid()
