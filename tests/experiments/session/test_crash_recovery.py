"""Files and journal agree again after a kill at any step of a verdict or a recovery."""

import json
import os
from contextlib import contextmanager
from itertools import takewhile
from pathlib import Path

import pytest

from acquisition.errors import SessionError
from acquisition.trial_file.recover import ROOM
from acquisition.trial_file.verify import verify_file
from experiments.session import crash_recovery
from experiments.session.crash_recovery import recover_session
from experiments.session.data_files import read_json, sha256_of
from experiments.session.journal import Journal, open_journal
from experiments.session.states import Event, SessionPhase
from experiments.session.store import create_session
from fakes.clock import SteppedClock
from tests.acquisition.trials import make_cycles, write_trial

STEPS = ("hardlink_to", "unlink", "replace")
MAX_STEPS = 60  # more changes of the disk than a verdict or a recovery makes


class KilledError(BaseException):
    """Stands for the death of the process."""


@pytest.fixture(autouse=True)
def no_disk(monkeypatch):
    """Skip fsync: no test here cuts the power."""
    monkeypatch.setattr(os, "fsync", lambda _: None)


class Now:
    def utc_ns(self):
        return 1_800_000_000 * 10**9


@contextmanager
def killed_at(step, monkeypatch):
    """Kill the process before its `step`-th change of the disk.

    Yields a list that stays empty if there were fewer steps.
    """
    left, was_killed = [step], []

    def count(original):
        def counted(*arguments, **named):
            left[0] -= 1
            if left[0] <= 0:
                raise KilledError
            return original(*arguments, **named)

        return counted

    with monkeypatch.context() as patch:
        for name in STEPS:
            patch.setattr(Path, name, count(getattr(Path, name)))
        patch.setattr(os, "fsync", count(os.fsync))
        try:
            yield was_killed
        except KilledError:
            was_killed.append(step)


def make_session(data):
    """Journal of an ended session: T01 and T02 kept, T01 rejected once."""
    folder = create_session(data, "S0", is_simulated=True, utc_ns=Now().utc_ns())
    book = Journal(folder, Now())
    book.append(Event.STARTED, terrain="S0", trials=2)
    book.append(Event.ACTIVATED)
    record(book, 1, 1, Event.TRIAL_REJECTED)
    record(book, 1, 2, Event.TRIAL_KEPT)
    record(book, 2, 1, Event.TRIAL_KEPT)
    book.append(Event.ENDED, reason="complete")
    return book


def record(book, number, attempt, verdict):
    fields = {"trial": number, "attempt": attempt}
    book.append(Event.TRIAL_STARTED, **fields)
    path = book.folder.trials / f"T{number:02d}.mcap"
    path.write_bytes(f"{number}.{attempt}".encode())
    path.with_suffix(".truth.mcap").write_bytes(f"truth {number}.{attempt}".encode())
    recording = {"sha256": sha256_of(path), "size": path.stat().st_size}
    book.append(Event.TRIAL_RECORDED, **fields, recording=recording)
    book.append(verdict, **fields, reason="", who="mk")


def contents(folder):
    """{content: location} of every recording and truth file."""
    paths = [*folder.trials.iterdir(), *folder.rejected.iterdir()]
    files = [p for p in paths if p.suffix != ".json"]
    locations = {p.read_text(): f"{p.parent.name}/{p.name}" for p in files}
    assert len(locations) == len(files), "a file is there twice"
    return locations


def check_agreement(folder):
    """Check the files against the journal."""
    book = open_journal(folder, Now())
    kept = [path.stem for path in folder.kept_trials()]
    assert kept == sorted(f"T{number:02d}" for number in book.state.kept)
    for number, attempt in book.state.kept_attempts:
        assert (folder.trials / f"T{number:02d}.mcap").read_text() == (
            f"{number}.{attempt}"
        )
    assert len(list(folder.rejected.glob("T*.json"))) == book.state.rejected
    names = {f.name for f in [*folder.trials.iterdir(), *folder.rejected.iterdir()]}
    assert not [name for name in names if name.endswith((".tmp", ".partial"))]


def kill_in_verdict(data, monkeypatch, step, verdict):
    """Kill a process during a verdict on T01 and recover; False if not killed."""
    book = make_session(data)
    before = set(contents(book.folder))
    fields = {"trial": 1, "verdict": "reject", "attempt": 2, "reason": "", "who": "mk"}
    if verdict == "keep":  # the other attempt at the same number
        book.append(Event.VERDICT, **fields)
        fields |= {"verdict": "keep", "attempt": 1}
    with killed_at(step, monkeypatch) as was_killed:
        book.append(Event.VERDICT, **fields)
    recover_session(open_journal(book.folder, Now()))
    check_agreement(book.folder)
    assert set(contents(book.folder)) == before
    return bool(was_killed)


@pytest.mark.parametrize("verdict", ["reject", "keep"])
def test_a_kill_at_any_step_of_a_verdict_loses_nothing(tmp_path, monkeypatch, verdict):
    steps = range(1, MAX_STEPS)
    killed = takewhile(
        lambda n: kill_in_verdict(tmp_path / str(n), monkeypatch, n, verdict), steps
    )
    assert 5 < len(list(killed)) < MAX_STEPS - 1  # every step was tried


def test_recovery_of_an_intact_session_changes_nothing(tmp_path):
    folder = make_session(tmp_path).folder
    texts = {p: p.read_bytes() for p in folder.path.rglob("*") if p.is_file()}
    assert recover_session(open_journal(folder, Now())) == ""
    assert texts == {p: p.read_bytes() for p in folder.path.rglob("*") if p.is_file()}


def crash(data):
    """Journal of a session killed in T01."""
    folder = create_session(data, "S0", is_simulated=True, utc_ns=Now().utc_ns())
    book = Journal(folder, Now())
    book.append(Event.STARTED, terrain="S0", trials=2)
    book.append(Event.ACTIVATED)
    book.append(Event.TRIAL_STARTED, trial=1, attempt=1)
    return book


def leave_partial(book):
    """Leave a `.partial` of 0.4 s, as after a kill."""
    writer = write_trial(book.folder.trials / "T01.mcap", make_cycles(201), block=67)
    writer.close_partial()
    return writer.partial


@pytest.fixture
def crashed(tmp_path):
    return crash(tmp_path)


def test_a_running_trial_is_recovered_and_rejected_and_its_partial_kept(crashed):
    source = sha256_of(leave_partial(crashed))
    assert (
        recover_session(crashed)
        == "T01 will be redone, its data are in rejected/T01a.*"
    )
    rejected = crashed.folder.rejected
    assert verify_file(rejected / "T01a.mcap").cycles == 201
    assert sha256_of(rejected / "T01a.partial") == source
    assert read_json(rejected / "T01a.json")["cycles"] == 201
    assert list(crashed.folder.trials.iterdir()) == []
    assert (crashed.state.phase, crashed.state.running) == (SessionPhase.CRASHED, None)


def test_a_finished_trial_without_a_verdict_is_rejected_unchanged(crashed):
    path = crashed.folder.trials / "T01.mcap"
    path.write_bytes(b"1.1")
    recording = {"sha256": sha256_of(path), "displacement": 0.4}
    fields = {"trial": 1, "attempt": 1}
    crashed.append(Event.TRIAL_RECORDED, **fields, recording=recording)
    recover_session(crashed)
    fields = read_json(crashed.folder.rejected / "T01a.json")
    assert (fields["displacement"], fields["verdict"]) == (0.4, "reject")
    assert (crashed.folder.rejected / "T01a.mcap").read_bytes() == b"1.1"


@pytest.mark.parametrize("content", [None, b"", b"nothing that can be saved"])
def test_a_trial_without_recoverable_data_is_still_a_rejected_attempt(crashed, content):
    if content is not None:
        (crashed.folder.trials / "T01.mcap.partial").write_bytes(content)
    recover_session(crashed)
    assert read_json(crashed.folder.rejected / "T01a.json")["sha256"] == ""
    assert (crashed.folder.rejected / "T01a.partial").exists() == (content is not None)
    assert crashed.state.rejected == 1


def kill_in_recovery(data, monkeypatch, step):
    """Kill a process during a recovery and recover; False if not killed."""
    crashed = crash(data)
    leave_partial(crashed)
    with killed_at(step, monkeypatch) as was_killed:
        recover_session(crashed)
    recover_session(open_journal(crashed.folder, Now()))
    book = open_journal(crashed.folder, Now())
    assert (book.state.running, book.state.rejected) == (None, 1)
    rejected = crashed.folder.rejected
    assert verify_file(rejected / "T01a.mcap").cycles == 201
    assert (rejected / "T01a.partial").exists()
    left = [p.name for p in crashed.folder.trials.iterdir() if p.name[0] != "."]
    assert left == []
    return bool(was_killed)


def test_a_kill_at_any_step_of_a_recovery_loses_nothing(tmp_path, monkeypatch):
    steps = range(1, MAX_STEPS)
    killed = takewhile(
        lambda n: kill_in_recovery(tmp_path / str(n), monkeypatch, n), steps
    )
    assert 5 < len(list(killed)) < MAX_STEPS - 1  # every step was tried


def test_a_torn_journal_line_is_ended_before_the_next_event(crashed):
    path = crashed.folder.path / "events.jsonl"
    with path.open("ab") as file:
        file.write(b'{"event": "trial-rec')
    book = open_journal(crashed.folder, Now())
    book.append(Event.NOTED, text="after the kill")
    *_, torn, last = path.read_text().splitlines()
    assert torn == '{"event": "trial-rec'
    assert json.loads(last)["text"] == "after the kill"
    assert open_journal(crashed.folder, Now()).state == book.state


def test_recovery_waits_for_a_recorder_that_still_writes(crashed, monkeypatch):
    looks = [True, True, False]
    monkeypatch.setattr(crash_recovery, "is_claimed", lambda _: looks.pop(0))
    recover_session(crashed)
    assert looks == []
    assert crashed.state.running is None


def test_recovery_removes_only_temporary_files_of_a_killed_process(crashed):
    folder = crashed.folder
    gone = 2**22 + 1  # no process has this number
    left = folder.trials / f"{ROOM}-{gone}-abcdefgh"
    left.mkdir()
    (left / "half.json").write_text("{")
    (folder.trials / "T09.json.tmp").write_text("{")
    (folder.trials / "notes.odt.tmp").write_text("a person's")
    recover_session(crashed)
    assert not left.exists()
    assert [p.name for p in folder.trials.iterdir()] == ["notes.odt.tmp"]


@pytest.mark.parametrize("damaged", [b"{", b"", b"[]", None])
def test_a_recording_with_a_damaged_sidecar_is_still_set_aside(tmp_path, damaged):
    book = make_session(tmp_path)
    folder = book.folder
    sidecar = folder.trials / "T02.json"
    sidecar.unlink() if damaged is None else sidecar.write_bytes(damaged)
    book.append(Event.REDO, trial=2, reason="wet")
    book.append(Event.ACTIVATED)
    book.append(Event.SET_ASIDE, trial=2, attempt=1, reason="redone", who="mk")
    assert contents(folder)["2.1"] == "rejected/T02a.mcap"
    assert contents(folder)["truth 2.1"] == "rejected/T02a.truth.mcap"
    assert read_json(folder.rejected / "T02a.json")["reason"] == "redone"
    assert not sidecar.exists()


def test_a_damaged_sidecar_does_not_move_the_recording_of_another_attempt(tmp_path):
    """T01b was kept and its sidecar is damaged: T01a was rejected before."""
    book = make_session(tmp_path)
    folder = book.folder
    (folder.trials / "T01.json").write_bytes(b"{")
    (folder.rejected / "T01a.mcap").unlink()
    recover_session(open_journal(folder, Now()))
    assert (folder.trials / "T01.mcap").read_text() == "1.2"
    assert not (folder.rejected / "T01a.mcap").exists()


def test_recovery_gives_up_on_a_recorder_that_never_ends(crashed, monkeypatch):
    clock = SteppedClock()
    began_ns, asked_ns = clock.now_ns(), []

    def is_claimed(_):
        asked_ns.append(clock.now_ns() - began_ns)
        return True

    monkeypatch.setattr(crash_recovery, "SystemClock", lambda: clock)
    monkeypatch.setattr(crash_recovery, "is_claimed", is_claimed)
    before = crashed.folder.events()
    with pytest.raises(SessionError, match="still ends a trial file"):
        recover_session(crashed)
    assert asked_ns[-1] == crash_recovery.RECORDER_TIMEOUT_NS
    assert len(asked_ns) > 100
    assert crashed.folder.events() == before
