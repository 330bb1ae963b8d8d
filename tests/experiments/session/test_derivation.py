"""Sidecars, file locations and session.json are derived from the journal.

The session has a rejected and a kept attempt at T01, notes, verdicts that are changed
later, and a redo of T02.
"""

import os
import shutil
import tarfile
from dataclasses import dataclass

import pytest

from acquisition.trial_file.verify import verify_file
from acquisition.trial_file.writer import publish
from experiments.session.crash_recovery import recover_session
from experiments.session.data_files import read_json, sha256_of
from experiments.session.derivation import derive, sidecar_of
from experiments.session.journal import Journal, open_journal
from experiments.session.kept_files import compare_kept
from experiments.session.reducer import replay
from experiments.session.sidecar import TrialName, TrialOutcome, recording_of
from experiments.session.states import Event
from experiments.session.store import SessionFolder, create_session, list_sessions
from tests.acquisition.trials import make_cycles, write_trial
from tests.crash.disk import after_all
from tests.crash.syscalls import MakeFolder, SyncFile, SyncFolder, recorded
from tests.experiments.test_recorded_session import SESSION

CYCLES = 20  # of a trial
NEEDED = {"trials", "rejected", "faults"}  # folders of a session


class Now:
    def utc_ns(self):
        return 1_800_000_000 * 10**9


@pytest.fixture(autouse=True)
def no_disk(monkeypatch):
    """Skip fsync: no test here cuts the power."""
    monkeypatch.setattr(os, "fsync", lambda _: None)


@dataclass
class Story:
    """Writes a session and records its derived files after each event.

    Attributes:
        journal: journal of the session.
        after: derived files by the number of events.
    """

    journal: Journal
    after: dict[int, dict[str, object]] | None = None

    def append(self, event, **details):
        self.journal.append(event, **details)
        if self.after is not None:
            self.after[len(self.after) + 1] = derived_files(self.journal.folder)

    def record(self, number, attempt, verdict, reason=""):
        fields = {"trial": number, "attempt": attempt}
        self.append(Event.TRIAL_STARTED, **fields)
        recording = write_recording(self.journal.folder, TrialName(number, attempt))
        self.append(Event.TRIAL_RECORDED, **fields, recording=recording)
        self.append(verdict, **fields, reason=reason, who="mk")

    def tare(self, t_ns):
        self.append(Event.TARED, t_ns=t_ns, bias=[0.1 * t_ns] * 6, spread=0.1)

    def write_session(self):
        self.append(Event.STARTED, terrain="TF", trials=2, operator="mk")
        self.append(Event.ACTIVATED)
        self.tare(1)
        self.record(1, 1, Event.TRIAL_REJECTED, "tilted")
        self.tare(2)
        self.append(Event.NOTED, trial=1, attempt=1, text="on the edge", who="mk")
        self.record(1, 2, Event.TRIAL_KEPT)
        self.tare(3)
        self.record(2, 1, Event.TRIAL_KEPT)
        self.append(Event.ENDED, reason="complete")
        self.append(Event.NOTED, trial=1, attempt=2, text="wet", who="km")
        for attempt, verdict in ((2, "reject"), (1, "keep")):
            details = {"verdict": verdict, "reason": "seen again", "who": "km"}
            self.append(Event.VERDICT, trial=1, attempt=attempt, **details)
        self.append(Event.REDO, trial=2, reason="wet", operator="km")
        self.append(Event.ACTIVATED)
        self.append(Event.SET_ASIDE, trial=2, attempt=1, reason="redone", who="km")
        self.record(2, 2, Event.TRIAL_KEPT)
        self.tare(4)
        self.append(Event.ENDED, reason="complete")


def write_recording(folder, name):
    """Write a trial file and its truth; the recording's fields for the journal."""
    path = folder.trials / f"{name.kept}.mcap"
    cycles = make_cycles(CYCLES, seed=10 * name.number + name.attempt)
    writer = write_trial(path, cycles, block=CYCLES)
    writer.finish("travel")
    publish(writer)
    truth = f"truth of {name}".encode()
    path.with_suffix(".truth.mcap").write_bytes(truth)
    recording = recording_of(verify_file(path), TrialOutcome("travel", 0.1, 0.4))
    return {**recording, "ratio": 0.6 + 0.1 * name.attempt, "traces": {"v_t": [None]}}


def derived_files(folder):
    """Locations and contents of all files derived from the journal.

    Files of a trial that is being recorded are left out.
    """
    running = {a.name.kept for a in replay(folder.events()).attempts if is_new(a)}
    paths = [*folder.trials.glob("T*"), *folder.rejected.glob("T*")]
    files = {
        f"{path.parent.name}/{path.name}": path.read_bytes()
        for path in paths
        if path.suffix in {".json", ".mcap"} and path.name.split(".")[0] not in running
    }
    return {**files, "session.json": read_json(folder.path / "session.json")}


def is_new(attempt):
    return not attempt.is_recorded and not attempt.verdicts


@pytest.fixture(scope="module")
def written_story(tmp_path_factory):
    """The story and the disk operations that wrote it."""
    root = tmp_path_factory.mktemp("written_story")
    with recorded(root) as recording:
        utc_ns = Now().utc_ns()
        folder = create_session(root, "TF", is_simulated=True, utc_ns=utc_ns)
        story = Story(Journal(folder, Now()), after={})
        story.write_session()
    return story, recording


@pytest.fixture
def folder(written_story, tmp_path):
    """A copy of the session that tests may damage."""
    source = written_story[0].journal.folder.path
    shutil.copytree(source, tmp_path / "sessions" / source.name)
    return list_sessions(tmp_path)[0]


def lose_derived_files(folder: SessionFolder):
    """Delete session.json and sidecars, and misplace the recordings."""
    for path in [*folder.path.rglob("T*.json"), folder.path / "session.json"]:
        path.unlink(missing_ok=True)
    state = replay(folder.events())
    judged = [attempt for attempt in state.attempts if attempt.verdicts]
    kept = [attempt for attempt in judged if not attempt.is_rejected]
    for attempt in kept:
        move(folder, attempt.relative_stem, f"rejected/{attempt.name.rejected}")
    rejected = {a.name.number: a for a in judged if a.is_rejected}  # one of each trial
    for attempt in rejected.values():
        move(folder, attempt.relative_stem, f"trials/{attempt.name.kept}")


def move(folder, place, other):
    for suffix in (".mcap", ".truth.mcap"):
        path = folder.path / f"{place}{suffix}"
        if path.exists():
            path.rename(folder.path / f"{other}{suffix}")


def test_lost_or_misplaced_files_are_derived_again(written_story, folder):
    before = derived_files(folder)
    assert sorted(before) == [
        *("rejected/T01b.json", "rejected/T01b.mcap", "rejected/T01b.truth.mcap"),
        *("rejected/T02a.json", "rejected/T02a.mcap", "rejected/T02a.truth.mcap"),
        "session.json",
        *("trials/T01.json", "trials/T01.mcap", "trials/T01.truth.mcap"),
        *("trials/T02.json", "trials/T02.mcap", "trials/T02.truth.mcap"),
    ]
    lose_derived_files(folder)
    assert derived_files(folder).keys() != before.keys()
    derive(folder, replay(folder.events()))
    assert derived_files(folder) == before
    assert written_story[0].journal.state == replay(folder.events())


def test_a_sidecar_holds_verdict_notes_tare_and_review_of_the_journal(folder):
    first = read_json(folder.trials / "T01.json")
    assert (first["verdict"], first["reason"], first["who"]) == (
        *("keep", "seen again", "km"),
    )
    assert [old["verdict"] for old in first["history"]] == ["reject"]
    assert [note["text"] for note in first["notes"]] == ["on the edge"]
    assert first["next_tare"] == {"t_ns": 2, "bias": [0.2] * 6}
    assert (first["displacement"], first["ratio"]) == (0.4, 0.7)
    assert "next_tare" not in read_json(folder.rejected / "T02a.json")


def test_consistent_files_are_not_rewritten(folder):
    before = {p: p.stat().st_ino for p in folder.path.rglob("*")}
    derive(folder, replay(folder.events()))
    assert {p: p.stat().st_ino for p in folder.path.rglob("*")} == before


@pytest.mark.parametrize(
    "damaged", [b"{", b"{}", b'{"attempt": 2}', b'{"attempt": 1, "verdict": "reject"}']
)
def test_a_damaged_sidecar_is_replaced_and_moves_no_recording(folder, damaged):
    before = derived_files(folder)
    for name in ("trials/T01.json", "trials/T02.json", "rejected/T02a.json"):
        (folder.path / name).write_bytes(damaged)
    derive(folder, replay(folder.events()))
    assert derived_files(folder) == before


def test_a_duplicate_recording_is_removed_and_an_unknown_one_left_alone(folder):
    before = derived_files(folder)
    shutil.copy(folder.trials / "T01.mcap", folder.rejected / "T01a.mcap")
    shutil.copy(folder.rejected / "T02a.mcap", folder.rejected / "T02c.mcap")
    derive(folder, replay(folder.events()))
    (folder.rejected / "T02c.mcap").unlink()  # of no attempt: left alone
    assert derived_files(folder) == before


def test_nothing_is_derived_from_a_lost_journal(folder):
    before = derived_files(folder)
    (folder.path / "events.jsonl").unlink()
    recover_session(open_journal(folder, Now()))
    assert derived_files(folder) == before


def test_readers_follow_the_journal_and_write_nothing(folder):
    state = replay(folder.events())
    wanted = [sidecar_of(folder, attempt) for attempt in state.attempts]
    sums = [sha256_of(path) for path in folder.kept_trials()]
    for path in [*folder.trials.glob("*.json"), *folder.rejected.glob("*.json")]:
        path.unlink()
    for kept in state.kept_trials:
        move(folder, kept.relative_stem, f"rejected/{kept.name.rejected}")
    before = {p: p.stat().st_ino for p in folder.path.rglob("*")}
    assert [sha256_of(path) for path in folder.kept_trials()] == sums
    assert [sidecar_of(folder, attempt) for attempt in state.attempts] == wanted
    assert {d.file for d in compare_kept(folder)} == {
        "trials/T01.json",
        "trials/T02.json",
    }
    assert {p: p.stat().st_ino for p in folder.path.rglob("*")} == before


# --- a kill at every write ------------------------------------------------------------


def kills(operations):
    """State of the disk after each operation that changes it."""
    for count, operation in enumerate(operations, 1):
        disk = after_all(operations[:count])
        is_made = {path.name for path in disk.folders()} >= NEEDED
        if is_made and not isinstance(operation, SyncFile | SyncFolder | MakeFolder):
            yield disk


@pytest.mark.timeout(120)
def test_a_kill_at_any_write_leaves_the_files_of_the_last_event(
    written_story, tmp_path
):
    story, recording = written_story
    seen = set()
    for number, disk in enumerate(kills(recording.operations)):
        disk.write(tmp_path / str(number))
        (folder,) = list_sessions(tmp_path / str(number))
        events = folder.events()
        assert len(folder.kept_trials()) == len(replay(events).kept)
        assert compare_kept(folder) == []
        derive(folder, replay(events))
        if events:
            assert derived_files(folder) == story.after[len(events)]
        seen.add(len(events))
    assert seen == {0, *story.after}


def resume(folder):
    """Recover a killed session and record the missing trials."""
    recover_session(open_journal(folder, Now()))
    story = Story(open_journal(folder, Now()))
    state = story.journal.state
    if not state.openings:
        story.append(Event.STARTED, terrain="TF", trials=2, operator="mk")
    elif state.is_complete:
        return
    else:
        story.append(Event.RESUMED, operator="km")
    story.append(Event.ACTIVATED)
    while not (state := story.journal.state).is_complete:
        number = state.next_trial
        story.record(number, state.attempt(number) + 1, Event.TRIAL_KEPT)
    story.append(Event.ENDED, reason="complete")


@pytest.mark.slow  # hundreds of sessions resumed
@pytest.mark.timeout(300)
def test_a_session_killed_at_any_write_is_completed_without_loss(
    written_story, tmp_path
):
    _, recording = written_story
    for number, disk in enumerate(kills(recording.operations)):
        disk.write(tmp_path / str(number))
        (folder,) = list_sessions(tmp_path / str(number))
        events, sums = folder.events(), recordings(folder)
        resume(folder)
        assert folder.events()[: len(events)] == events
        assert recordings(folder) >= sums
        assert compare_kept(folder) == []
        assert len(folder.kept_trials()) == 2
        left = [path.name for path in folder.path.rglob("*.*") if is_left(path)]
        assert left == []
        files = derived_files(folder)
        lose_derived_files(folder)
        derive(folder, replay(folder.events()))
        assert derived_files(folder) == files


def recordings(folder):
    """Contents of all recordings with their final names."""
    return {path.read_bytes() for path in folder.path.rglob("T*.mcap")}


def is_left(path):
    """Whether the file is a useless remnant of a kill."""
    is_partial = path.suffix == ".partial" and path.parent.name == "trials"
    return path.suffix == ".tmp" or is_partial


# --- a session of format 1.0 ----------------------------------------------------------


def test_a_recorded_session_of_format_1_0_is_consistent(tmp_path):
    with tarfile.open(SESSION) as archive:
        archive.extractall(tmp_path, filter="data")
    (folder,) = list_sessions(tmp_path)
    before = derived_files(folder)
    derive(folder, replay(folder.events()))
    assert derived_files(folder) == before


def test_lost_sidecars_of_format_1_0_are_derived_from_journal_and_recordings(tmp_path):
    with tarfile.open(SESSION) as archive:
        archive.extractall(tmp_path, filter="data")
    (folder,) = list_sessions(tmp_path)
    paths = sorted(folder.trials.glob("T??.json"))
    before = [read_json(path) for path in paths]
    lose_derived_files(folder)
    derive(folder, replay(folder.events()))
    of_review = {"ratio", "coverage", "slips", "v_t", "traces"}
    for path, fields in zip(paths, before, strict=True):
        lost = of_review | {"next_tare", "displacement"}
        now = read_json(path)
        assert {k: v for k, v in now.items() if k not in lost} == {
            k: v for k, v in fields.items() if k not in lost
        }
    assert compare_kept(folder) == []
