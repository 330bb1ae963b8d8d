import json
import shutil
from pathlib import Path

import pytest

from experiments.session.kept_files import compare_kept
from experiments.session.store import find_session
from tests.experiments.program import digest, journal, only_session, sidecar, traction

pytestmark = pytest.mark.slow  # whole sessions


@pytest.fixture
def data(recorded, tmp_path):
    """A data folder with two kept trials that tests may damage."""
    shutil.copytree(recorded.data, tmp_path / "data")
    return tmp_path / "data"


@pytest.fixture
def damaged(data):
    """The same data with one sidecar deleted and another trial truncated."""
    trials = only_session(data) / "trials"
    (trials / "T01.json").unlink()
    cut(trials / "T02.mcap")
    return data


def cut(path):
    path.chmod(0o644)
    path.write_bytes(path.read_bytes()[:-100])


def files(data):
    return {d.file for d in compare_kept(find_session(data, "S001"))}


def test_the_journal_has_checksum_and_size_of_every_kept_trial(recorded):
    kept = [e for e in journal(recorded.folder) if e["event"] == "trial-kept"]
    trials = recorded.folder / "trials"
    fields = [sidecar(trials / f"T0{event['trial']}.mcap") for event in kept]
    wanted = [(fact["sha256"], fact["size"]) for fact in fields]
    assert [(event["sha256"], event["size"]) for event in kept] == wanted


def test_a_trial_kept_after_the_session_has_its_checksum_in_the_journal(data):
    for verdict in ("reject", "keep"):
        done = traction("verdict", "S001", "T01a", verdict, "why", "--data", data)
        assert done.code == 0, done.err
    *_, event = journal(only_session(data))
    trial = only_session(data) / "trials" / "T01.mcap"
    assert event["sha256"] == sidecar(trial)["sha256"]


def test_a_sound_session_has_no_deviations(data):
    assert files(data) == set()


def test_missing_and_changed_files_are_reported(damaged):
    assert files(damaged) == {"trials/T01.json", "trials/T02.mcap"}


def test_a_trial_changed_together_with_its_sidecar_is_reported(data):
    path = only_session(data) / "trials" / "T01.mcap"
    cut(path)
    fields = sidecar(path) | {"sha256": digest(path)}
    path.with_suffix(".json").write_text(json.dumps(fields))
    assert files(data) == {"trials/T01.json", "trials/T01.mcap"}


def _empty(session):
    (session / "events.jsonl").write_bytes(b"")


def _missing(session):
    (session / "events.jsonl").unlink()


def _cut_after_first_kept(session):
    """Truncate the journal after the line that kept T01."""
    path = session / "events.jsonl"
    lines = path.read_bytes().splitlines(keepends=True)
    first = next(i for i, line in enumerate(lines) if b"trial-kept" in line)
    path.write_bytes(b"".join(lines[: first + 1]))


def _without_a_keep(session):
    path = session / "events.jsonl"
    lines = path.read_bytes().splitlines(keepends=True)
    last = max(i for i, line in enumerate(lines) if b"trial-kept" in line)
    path.write_bytes(b"".join(lines[:last] + lines[last + 1 :]))


def _without_a_tare(session):
    """Remove a line that changes no state."""
    path = session / "events.jsonl"
    lines = path.read_bytes().splitlines(keepends=True)
    first = next(i for i, line in enumerate(lines) if b"tared" in line)
    path.write_bytes(b"".join(lines[:first] + lines[first + 1 :]))


def _with_a_line_twice(session):
    path = session / "events.jsonl"
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join([*lines[:3], lines[2], *lines[3:]]))


LOSSES = (
    _empty,
    _missing,
    _cut_after_first_kept,
    _without_a_keep,
    _without_a_tare,
    _with_a_line_twice,
)


@pytest.mark.parametrize("lose", LOSSES)
def test_a_damaged_journal_is_reported(data, lose):
    lose(only_session(data))
    assert "events.jsonl" in files(data)
    done = traction("verify", "--all", "--data", data)
    assert done.code == 6
    assert "events.jsonl" in done.err


@pytest.mark.parametrize("lose", LOSSES)
def test_no_report_is_made_of_a_session_with_a_damaged_journal(data, lose):
    lose(only_session(data))
    done = traction("report", "S001", "--data", data)
    assert done.code == 6
    assert "Not as in the journal: S001 events.jsonl " in done.err


@pytest.mark.parametrize("lose", LOSSES)
@pytest.mark.parametrize("command", [("resume", "S001"), ("redo", "S001", "T01")])
def test_a_session_with_a_damaged_journal_is_neither_opened_nor_changed(
    data, lose, command
):
    """Only the derived files show which lines the journal lost."""
    session = only_session(data)
    lose(session)
    before = {p: p.read_bytes() for p in session.rglob("*.*") if p.name != ".lock"}
    done = traction(*command, "--data", data)
    assert done.code == 6
    assert "S001 events.jsonl " in done.err
    after = {p: p.read_bytes() for p in session.rglob("*.*") if p.name != ".lock"}
    assert after == before


@pytest.mark.parametrize("lose", [_empty, _missing, _cut_after_first_kept])
def test_a_changed_recording_is_reported_without_the_journal(data, lose):
    session = only_session(data)
    lose(session)
    path = session / "trials" / "T02.mcap"
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.chmod(0o644)
    path.write_bytes(content)
    assert "trials/T02.mcap" in files(data)


@pytest.mark.parametrize("lose", [_empty, _missing, _cut_after_first_kept])
def test_a_missing_recording_is_reported_without_the_journal(data, lose):
    session = only_session(data)
    lose(session)
    for path in session.glob("trials/T02.*"):
        path.unlink()
    assert "trials/T02.mcap" in files(data)


def test_verify_fails_without_any_session(tmp_path):
    done = traction("verify", "--all", "--data", tmp_path)
    assert done.code == 2
    assert f"There is no session in {tmp_path / 'sessions'}" in done.err


def test_a_session_folder_with_a_foreign_name_is_reported(data):
    session = only_session(data)
    session.rename(session.with_name("my favourite"))
    done = traction("verify", "--all", "--data", data)
    assert done.code == 6
    assert "my favourite holds a journal, and is not called like a session" in done.err


def test_a_sidecar_unknown_to_the_journal_is_reported(data):
    trials = only_session(data) / "trials"
    for suffix in (".mcap", ".json"):
        shutil.copy(trials / f"T01{suffix}", trials / f"T09{suffix}")
    assert files(data) == {"trials/T09.json"}


@pytest.mark.parametrize(
    "arguments",
    [
        ("status",),
        ("status", "--json"),
        ("report", "S001"),
        ("report", "--all"),
        ("export", "S001", "--to", "{}/tables"),
        ("export", "--terrain-db", "{}/terrains.json"),
        ("redo", "S001", "T01"),
        ("replay", "S001", "T02"),
        ("verify", "S001"),
        ("verify", "--all"),
    ],
    ids=" ".join,
)
def test_a_command_fails_and_names_a_damaged_recording(damaged, config, arguments):
    arguments = [a.format(damaged.parent) for a in arguments]
    done = traction(*arguments, "--data", damaged, "--config", config)
    assert done.code == 6
    assert "trials/T02.mcap" in done.err
    assert not (damaged.parent / "tables").exists()


def test_verify_lists_deviations_as_json(damaged):
    done = traction("verify", "--all", "--json", "--data", damaged)
    assert done.code == 6
    found = {(row["session"], row["file"]) for row in json.loads(done.out)}
    assert found == {("S001", "trials/T01.json"), ("S001", "trials/T02.mcap")}


def test_verify_accepts_a_sound_session(data):
    assert traction("verify", "S001", "--data", data).code == 0


def test_verify_requires_sessions_or_all(data):
    assert traction("verify", "--data", data).code == 2


@pytest.mark.parametrize(
    ("lost", "exported"),
    [("T01.mcap", ["T02.csv"]), ("T01.json", ["T01.csv", "T02.csv"])],
)
def test_the_remaining_trials_are_exported_with_allow_missing(
    data, config, lost, exported
):
    """A lost sidecar is only reported: the journal states that the trial is kept."""
    (only_session(data) / "trials" / lost).unlink()
    to = data.parent / "tables"
    arguments = ("export", "S001", "--to", to, "--allow-missing")
    done = traction(*arguments, "--data", data, "--config", config)
    assert done.code == 0
    assert lost in done.err
    assert sorted(path.name for path in to.glob("*/T0?.csv")) == exported


def test_a_report_names_a_missing_sidecar_at_its_top(data, config):
    (only_session(data) / "trials" / "T01.json").unlink()
    arguments = ("report", "S001", "--allow-missing", "--models", "tustin")
    done = traction(*arguments, "--data", data, "--config", config)
    assert done.code == 0, done.err
    page = (only_session(data) / "report" / "index.html").read_text()
    assert "T01.json" in page.partition("<h2")[0]


# --- the same recording twice ---------------------------------------------------------


@pytest.fixture
def copied(data):
    """Data in which the session was copied under another number."""
    folder = only_session(data)
    name = folder.name.replace("_S001_", "_S002_")
    shutil.copytree(folder, folder.with_name(name))
    return data


def test_a_copied_session_is_reported(copied):
    done = traction("verify", "--all", "--data", copied)
    assert done.code == 6
    assert "S002 session.json is of S001: a copy, or a renamed session" in done.err
    assert done.err.count("✘") == 1


def test_the_trials_of_a_copy_are_counted_once(copied):
    done = traction("status", "--json", "--data", copied)
    (row,) = [row for row in json.loads(done.out) if row["sessions"]]
    assert (row["kept"], row["sessions"]) == (2, ["S001", "S002"])
    assert traction("status", "--data", copied).code == 6


def test_a_report_counts_a_recording_once(copied, config):
    where = ("--models", "tustin", "--data", copied, "--config", config)
    refused = traction("report", "--all", *where)
    assert refused.code == 6
    assert "S002 session.json is of S001" in refused.err
    done = traction("report", "--all", "--allow-missing", *where)
    assert done.code == 0, done.err
    assert "left out: S002 T01 is the same recording as S001 T01" in done.out
    page = Path(done.out.rpartition("Open in a browser: ")[2].strip())
    assert "S002 T01 is the same recording as S001 T01" in page.read_text()
    fits = json.loads((page.parent.parent / "fits.json").read_text())
    (terrain,) = fits["terrains"].values()
    assert terrain["trials"] == 2
    report = json.loads(
        traction("report", "--all", "--allow-missing", "--json", *where).out
    )
    assert report["left_out"] == [
        "S002 T01 is the same recording as S001 T01",
        "S002 T02 is the same recording as S001 T02",
    ]


def test_a_renumbered_session_without_a_copy_counts(data):
    folder = only_session(data)
    folder.rename(folder.with_name(folder.name.replace("_S001_", "_S004_")))
    done = traction("status", "--json", "--data", data)
    (row,) = [row for row in json.loads(done.out) if row["sessions"]]
    assert (row["kept"], row["sessions"]) == (2, ["S004"])


@pytest.mark.parametrize(
    ("change", "deviation"),
    [
        (lambda name: name.removesuffix(".fake"), "is of simulated trials"),
        (lambda name: name.replace("_TF", "_S0"), "is of TF"),
    ],
)
def test_a_session_whose_name_contradicts_its_journal_does_not_count(
    data, change, deviation
):
    folder = only_session(data)
    folder.rename(folder.with_name(change(folder.name)))
    done = traction("verify", "--all", "--data", data)
    assert (done.code, deviation in done.err) == (6, True)
    status = traction("status", "--json", "--data", data)
    assert status.code == 6
    assert [row for row in json.loads(status.out) if row["kept"]] == []


def test_a_copy_with_the_same_number_is_reported_and_does_not_count(data):
    folder = only_session(data)
    shutil.copytree(folder, folder.with_name("2099-01-01" + folder.name[10:]))
    done = traction("verify", "--all", "--data", data)
    assert done.code == 6
    assert f"has the number of {folder.name}" in done.err
    status = traction("status", "--json", "--data", data)
    (row,) = [row for row in json.loads(status.out) if row["kept"]]
    assert (status.code, row["kept"]) == (6, 2)
    asked = traction("verify", "S001", "--data", data)
    assert "S001 is the number of 2 sessions" in asked.err


@pytest.mark.parametrize("text", [None, "{"])
def test_a_missing_or_damaged_session_json_is_reported(data, text):
    path = only_session(data) / "session.json"
    path.unlink()
    if text is not None:
        path.write_text(text)
    done = traction("verify", "S001", "--data", data)
    assert done.code == 6
    assert "session.json is missing or damaged" in done.err
