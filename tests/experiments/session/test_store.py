import errno
import json
import os

import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.errors import SessionError, SettingsError, TrialFileError
from experiments.run.trial import AFTER_TRAVEL, EndDetector
from experiments.session import store
from experiments.session.data_files import (
    move_file,
    read_json,
    write_json,
    write_new_text,
)
from experiments.session.sidecar import TIME_LIMIT, TrialName
from experiments.session.store import (
    create_session,
    find_session,
    iso_utc,
    list_sessions,
)

DAY_NS = 1_800_000_000_000_000_000  # 2027-01-15T08:00:00Z


def create(data, terrain="S0", *, is_simulated=True):
    return create_session(data, terrain, is_simulated=is_simulated, utc_ns=DAY_NS)


def test_sessions_are_numbered_and_dated(tmp_path):
    names = [create(tmp_path).path.name, create(tmp_path, "B10").path.name]
    assert names == ["2027-01-15_S001_S0.fake", "2027-01-15_S002_B10.fake"]
    assert create(tmp_path, is_simulated=False).path.name == "2027-01-15_S003_S0"


def test_a_number_is_never_used_twice_even_after_a_gap(tmp_path):
    (tmp_path / "sessions" / "2026-12-31_S041_TF").mkdir(parents=True)
    assert create(tmp_path).id == "S042"


def test_folders_that_are_not_sessions_are_not_listed(tmp_path):
    create(tmp_path)
    for name in ("notes", "2027-01-15_S1_S0", "2027-01-15_S002_S0.fakes", "S003"):
        (tmp_path / "sessions" / name).mkdir()
    assert [session.id for session in list_sessions(tmp_path)] == ["S001"]


def test_a_session_is_found_by_id_name_and_path(tmp_path):
    session = create(tmp_path)
    for name in ("S001", session.path.name, str(session.path), f"{session.path}/"):
        assert find_session(tmp_path, name).path.name == session.path.name


def test_a_torn_last_line_of_the_journal_is_left_out(tmp_path):
    session = create(tmp_path)
    session.append_event({"event": "session-started", "terrain": "S0", "trials": 1})
    with (session.path / "events.jsonl").open("ab") as file:
        file.write(b'{"event": "trial-sta')
    assert [event["event"] for event in session.events()] == ["session-started"]


def record(session, number, verdict, *, is_sound=True):
    """Record a trial without a sidecar; its verdict is in the journal only."""
    path = session.trials / f"T{number:02d}.mcap"
    path.write_bytes(b"trial %d" % number)
    sums = {"sha256": store.sha256_of(path) if is_sound else "0" * 64}
    fields = {"trial": number, "attempt": 1}
    session.append_event({"event": "trial-started", **fields})
    session.append_event({"event": "trial-recorded", **fields, "recording": sums})
    session.append_event({"event": verdict, **fields})
    return path


def test_trials_kept_in_the_journal_count_if_their_checksum_is_right(tmp_path):
    session = create(tmp_path)
    session.append_event({"event": "session-started", "terrain": "S0", "trials": 4})
    session.append_event({"event": "activated"})
    sound = record(session, 1, "trial-kept")
    record(session, 2, "trial-kept", is_sound=False)
    record(session, 3, "trial-rejected")
    write_json(session.trials / "T04.json", {"verdict": "keep", "sha256": ""})
    assert session.kept_trials() == [sound]


def test_a_kept_trial_counts_before_its_files_are_moved(tmp_path):
    session = create(tmp_path)
    session.append_event({"event": "session-started", "terrain": "S0", "trials": 1})
    session.append_event({"event": "activated"})
    recorded = record(session, 1, "trial-kept")
    rejected = recorded.rename(session.rejected / "T01a.mcap")
    assert session.kept_trials() == [rejected]


def test_json_is_replaced_whole_or_not_at_all(tmp_path, monkeypatch):
    path = tmp_path / "session.json"
    write_json(path, {"kept": 1})

    def fail(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", fail)
    with pytest.raises(TrialFileError, match=r"cannot be written \(No space left"):
        write_json(path, {"kept": 2})
    assert read_json(path) == {"kept": 1}


def test_a_journal_that_is_a_folder_is_reported(tmp_path):
    session = create(tmp_path)
    (session.path / "events.jsonl").mkdir()
    with pytest.raises(TrialFileError, match="is a folder"):
        session.append_event({"event": "tared"})


def test_a_moved_trial_never_replaces_another(tmp_path):
    source, target = tmp_path / "T01.mcap", tmp_path / "T01a.mcap"
    source.write_text("new")
    target.write_text("old")
    with pytest.raises(TrialFileError, match="never overwritten"):
        move_file(source, target)
    assert (source.read_text(), target.read_text()) == ("new", "old")


@given(st.binary(max_size=60))
def test_a_damaged_json_file_reads_as_empty(tmp_path_factory, content):
    path = tmp_path_factory.getbasetemp() / "damaged.json"
    path.write_bytes(content)
    fields = read_json(path)
    assert fields == {} or json.loads(content) == fields


def test_a_data_folder_below_a_file_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(SettingsError, match="cannot be written"):
        create(tmp_path / "file")


def test_utc_is_written_in_whole_seconds():
    assert iso_utc(DAY_NS + 999_999_999) == "2027-01-15T08:00:00Z"


@pytest.mark.parametrize(
    ("attempt", "name"), [(1, "T04a"), (26, "T04z"), (27, "T04aa"), (53, "T04ba")]
)
def test_rejected_attempts_are_lettered_like_spreadsheet_columns(attempt, name):
    assert TrialName(4, attempt).rejected == name
    assert TrialName(4, attempt).kept == "T04"


def test_a_trial_ends_shortly_after_the_container_is_crossed():
    watch = EndDetector(0.45)
    assert watch.reason(5.0, 0.449) == ""
    assert watch.reason(6.0, 0.45) == ""
    late = 6.0 + AFTER_TRAVEL
    assert watch.reason(late - 0.01, 0.30) == ""  # even if the foot is lifted back
    assert watch.reason(late, 0.30) == "travel"


def test_a_trial_that_never_crosses_ends_at_the_time_limit():
    watch = EndDetector(0.45)
    assert watch.reason(TIME_LIMIT - 0.01, 0.2) == ""
    assert watch.reason(TIME_LIMIT, 0.2) == "time-limit"


def refuse(_):
    raise OSError(errno.ENOSPC, "No space left on device")


def test_a_session_that_fails_on_a_full_disk_leaves_no_folder(tmp_path, monkeypatch):
    create(tmp_path)
    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", refuse)
        with pytest.raises(SettingsError, match="cannot be written"):
            create(tmp_path)
    assert [folder.id for folder in list_sessions(tmp_path)] == ["S001"]
    assert create(tmp_path).id == "S002"


def test_a_new_file_that_cannot_be_synced_is_removed(tmp_path, monkeypatch):
    path = tmp_path / "gravity.toml"
    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", refuse)
        with pytest.raises(TrialFileError, match="cannot be written"):
            write_new_text(path, "a")
    assert not path.exists()
    write_new_text(path, "a")
    with pytest.raises(TrialFileError, match="never overwritten"):
        write_new_text(path, "b")
    assert path.read_text() == "a"


def test_a_file_given_as_a_session_is_refused_with_a_hint(tmp_path):
    folder = create(tmp_path)
    trial = folder.trials / "T01.mcap"
    trial.write_bytes(b"")
    table = tmp_path / "a.csv"
    table.write_text("t,v_t\n")
    for path, hint in ((trial, f"Name its session: {folder.id}"), (table, "fit FILE")):
        with pytest.raises(SessionError, match="is a file, not a session") as caught:
            find_session(tmp_path, str(path))
        assert hint in caught.value.hint


def test_a_folder_of_tables_given_as_a_session_is_refused_with_a_hint(tmp_path):
    (tmp_path / "gravel").mkdir()
    (tmp_path / "gravel" / "datapackage.json").write_text("{}")
    with pytest.raises(SessionError, match="is a folder of tables") as caught:
        find_session(tmp_path, str(tmp_path / "gravel"))
    assert caught.value.hint == f"traction fit {tmp_path / 'gravel'}"


@pytest.mark.parametrize("terrain", ["G12.5dt", "G12dt+10", "B.0"])
@pytest.mark.parametrize("is_simulated", [True, False])
def test_a_terrain_name_with_plus_signs_and_dots_is_read_from_the_folder(
    tmp_path, terrain, is_simulated
):
    made = create_session(tmp_path, terrain, is_simulated=is_simulated, utc_ns=0)
    (listed,) = list_sessions(tmp_path)
    assert (listed.path, listed.terrain) == (made.path, terrain)
    assert listed.is_simulated is is_simulated
