"""Every kind of damage to the files of a session is reported.

Each test damages a small session of two kept trials and a rejected one.
"""

import json
import shutil

import pytest

from acquisition.errors import TrialFileError
from experiments.session.data_files import journal_line, parse_journal, sha256_of
from experiments.session.kept_files import (
    KeptDataError,
    check_kept,
    compare_kept,
    compare_trial,
    repeated_numbers,
    repeated_trials,
)
from experiments.session.store import find_session, list_sessions
from tests.corpus.used_session import lay_out, session_files

SIZE = len(session_files()["sessions/2027-01-15_S001_TF.fake/trials/T01.mcap"])
CHECKSUM = "is changed: its checksum is wrong"


@pytest.fixture
def data(tmp_path):
    return lay_out(tmp_path)


@pytest.fixture
def session(data):
    return find_session(data, "S001")


def deviations(session):
    return {(d.file, d.problem) for d in compare_kept(session)}


def lines(session):
    return (session.path / "events.jsonl").read_bytes().splitlines(keepends=True)


def write_lines(session, kept):
    (session.path / "events.jsonl").write_bytes(b"".join(kept))


def change_json(path, **fields):
    path.write_text(json.dumps({**json.loads(path.read_text()), **fields}))


def drop(name):
    return lambda session: (session.path / name).unlink()


def replace(name, old, new):
    def damage(session):
        path = session.path / name
        path.write_bytes(path.read_bytes().replace(old, new, 1))

    return damage


def cut_lines(count):
    return lambda session: write_lines(session, lines(session)[:count])


def remove_line(number):
    def damage(session):
        all_lines = lines(session)
        write_lines(session, all_lines[: number - 1] + all_lines[number:])

    return damage


def set_json(name, **fields):
    return lambda session: change_json(session.path / name, **fields)


def flip(name):
    def damage(session):
        path = session.path / name
        content = bytearray(path.read_bytes())
        content[len(content) // 2] ^= 1
        path.write_bytes(content)

    return damage


def truncate_recording(session):
    path = session.path / "trials/T01.mcap"
    path.write_bytes(path.read_bytes()[:-100])


def add_trial(session):
    """Add a kept trial that is not in the journal, and damage its recording."""
    for suffix in (".json", ".mcap"):
        source = (session.path / "trials/T01.json").with_suffix(suffix)
        (session.path / "trials/T03").with_suffix(suffix).write_bytes(
            source.read_bytes()
        )
    change_json(session.path / "trials/T03.json", trial="T03", attempt=1)
    flip("trials/T03.mcap")(session)


def replace_by_link(session):
    path = session.path / "trials/T01.mcap"
    path.rename(session.path.parent / "elsewhere.mcap")
    path.symlink_to(session.path.parent / "elsewhere.mcap")


def change_terrain(session):
    """Make the first line of the journal name another terrain."""
    first, *rest = lines(session)
    ((event,), _) = parse_journal(first)
    write_lines(session, [journal_line({**event, "terrain": "S0"}, 1), *rest])


DAMAGES = {
    "journal empty": (
        cut_lines(0),
        {("events.jsonl", "is missing or empty; session.json is not")},
    ),
    "journal gone": (
        drop("events.jsonl"),
        {("events.jsonl", "is missing or empty; session.json is not")},
    ),
    "journal cut": (cut_lines(9), {("events.jsonl", "ends after 9 of 12 lines")}),
    "line of T02 lost": (
        remove_line(11),
        {
            ("events.jsonl", "lacks lines or has others: line 11 was line 12"),
            ("events.jsonl", "ends after 11 of 12 lines"),
            ("trials/T02.json", "is kept, but is not in the journal"),
        },
    ),
    "line changed": (
        replace("events.jsonl", b'"who": "mk"', b'"who": "km"'),
        {("events.jsonl", "has a wrong checksum in line 5")},
    ),
    "rejection lost": (
        remove_line(5),
        {("events.jsonl", "lacks lines or has others: line 5 was line 6")},
    ),
    "summary gone": (
        drop("session.json"),
        {("session.json", "is missing or damaged")},
    ),
    "summary of another session": (
        set_json("session.json", id="S007"),
        {("session.json", "is of S007: a copy, or a renamed session")},
    ),
    "summary with an extra trial": (
        set_json("session.json", kept=["T01", "T02", "T04"]),
        {("trials/T04.mcap", "is kept in session.json, not in the journal")},
    ),
    "summary without a list": (
        set_json("session.json", kept=7),
        {("session.json", "is missing or damaged")},
    ),
    "summary of another terrain": (
        set_json("session.json", terrain="B0"),
        {("session.json", "is of B0: a renamed session")},
    ),
    "sidecar gone": (
        drop("trials/T01.json"),
        {("trials/T01.json", "is missing or unreadable")},
    ),
    "sidecar with another checksum": (
        set_json("trials/T01.json", sha256="0" * 64),
        {("trials/T01.json", "states another checksum")},
    ),
    "recording gone": (drop("trials/T01.mcap"), {("trials/T01.mcap", "is missing")}),
    "bit flipped in a recording": (
        flip("trials/T02.mcap"),
        {("trials/T02.mcap", CHECKSUM)},
    ),
    "recording cut": (
        truncate_recording,
        {("trials/T01.mcap", f"is changed: {SIZE - 100} bytes, {SIZE} were kept")},
    ),
    "trial unknown to the journal": (
        add_trial,
        {
            ("trials/T03.json", "is kept, but is not in the journal"),
            ("trials/T03.mcap", CHECKSUM),
        },
    ),
    "another terrain in the journal": (
        change_terrain,
        {("events.jsonl", "is of S0: a renamed session")},
    ),
}


def test_a_sound_session_has_no_deviation(session):
    assert deviations(session) == set()


@pytest.mark.parametrize("name", DAMAGES)
def test_every_damage_is_reported(session, name):
    damage, wanted = DAMAGES[name]
    damage(session)
    reported = deviations(session)
    assert wanted <= reported
    others = {problem for file, problem in reported - wanted if file != "events.jsonl"}
    missing = "is kept, but is not in the journal"
    assert others <= {missing, "is kept in session.json, not in the journal"}


def test_a_recording_that_is_a_link_is_reported(session):
    replace_by_link(session)
    assert {d.file for d in compare_kept(session)} == {"trials/T01.mcap"}


def test_a_missing_session_json_is_reported_from_the_second_event_on(session):
    write_lines(session, lines(session)[:2])
    drop("session.json")(session)
    assert ("session.json", "is missing or damaged") in deviations(session)
    write_lines(session, lines(session)[:1])
    assert ("session.json", "is missing or damaged") not in deviations(session)


@pytest.mark.parametrize("fields", [{"kept": ["T01"]}, {"events": 12}])
def test_an_empty_journal_is_reported_if_session_json_has_events_or_trials(
    session, fields
):
    write_lines(session, [])
    (session.path / "session.json").write_text(json.dumps({"id": "S001", **fields}))
    missing = ("events.jsonl", "is missing or empty; session.json is not")
    assert missing in deviations(session)


def test_a_sidecar_with_an_invalid_name_is_reported(session):
    sidecar = json.loads((session.path / "trials/T01.json").read_text())
    (session.path / "trials/Tab.json").write_text(json.dumps(sidecar))
    assert deviations(session) == {
        ("trials/Tab.json", "is kept, but is not in the journal")
    }


def test_a_session_json_older_than_the_journal_is_no_deviation(session):
    change_json(session.path / "session.json", kept=["T01"], events=8)
    assert deviations(session) == set()


def test_a_torn_last_line_is_no_deviation(session):
    with (session.path / "events.jsonl").open("ab") as journal:
        journal.write(b'{"event": "trial-sta')
    assert deviations(session) == set()


@pytest.mark.parametrize("name", ["2027-01-15_S001_TF", "2027-01-15_S001_S0.fake"])
def test_a_folder_name_that_contradicts_the_journal_is_reported(data, session, name):
    ((first,), _) = parse_journal(lines(session)[0])
    line = journal_line({**first, "fake": {"seed": 1}}, 1)
    write_lines(session, [line, *lines(session)[1:]])
    session.path.rename(session.path.with_name(name))
    (renamed,) = list_sessions(data)
    problems = {d.problem for d in compare_kept(renamed)}
    assert any("a renamed session" in problem for problem in problems)


@pytest.mark.parametrize(("mark", "kind"), [("", "simulated"), (".fake", "recorded")])
def test_a_session_json_of_the_other_kind_is_reported(session, mark, kind):
    """session.json states the kind of session if the journal does not."""
    folder = session.path.rename(session.path.with_name(f"2027-01-15_S001_TF{mark}"))
    change_json(folder / "session.json", simulated=kind == "simulated")
    renamed = find_session(folder.parents[1], "S001")
    wanted = ("session.json", f"is of {kind} trials: a renamed session")
    assert wanted in deviations(renamed)


def test_files_not_yet_moved_to_match_the_journal_are_no_deviation(session):
    """A verdict is in the journal before the files are moved."""
    for suffix in (".json", ".mcap"):
        kept = session.path / f"trials/T01{suffix}"
        kept.rename(session.path / f"rejected/T01b{suffix}")
    assert deviations(session) == set()


def test_the_comparison_of_one_trial_ignores_the_others(session):
    flip("trials/T02.mcap")(session)
    assert compare_trial(session, session.path / "trials/T01.mcap") == []
    (reported,) = compare_trial(session, session.path / "trials/T02.mcap")
    assert reported.text() == f"S001 trials/T02.mcap {CHECKSUM}"


def test_deviations_are_refused_unless_they_are_allowed(session):
    assert check_kept([session], allow_missing=False) == []
    drop("trials/T01.mcap")(session)
    (reported,) = check_kept([session], allow_missing=True)
    assert reported.problem == "is missing"
    with pytest.raises(KeptDataError, match=r"S001 trials/T01\.mcap is missing\."):
        check_kept([session], allow_missing=False)


def test_a_long_list_of_deviations_is_shortened(session):
    for number in range(3, 12):
        name = f"trials/T{number:02d}.json"
        content = json.loads((session.path / "trials/T01.json").read_text())
        (session.path / name).write_text(
            json.dumps({**content, "trial": f"T{number:02d}", "attempt": 1})
        )
    with pytest.raises(KeptDataError) as refusal:
        check_kept([session], allow_missing=False)
    assert str(refusal.value).count("is kept, but is not in the journal") <= 6
    assert "; and 12 more." in str(refusal.value)


def test_a_repeated_session_number_is_reported_with_both_folders(data, session):
    copy = session.path.with_name("2027-01-16_S001_TF.fake")
    copy.mkdir()
    repeated = repeated_numbers(list_sessions(data))
    assert [d.text() for d in repeated.values()] == [
        f"S001 {copy.name} has the number of {session.path.name}"
    ]


def test_trials_of_a_copied_session_are_recognised_by_checksum(data, session):
    copy = session.path.with_name("2027-01-15_S002_TF.fake")
    shutil.copytree(session.path, copy)
    events = find_session(data, "S002").events()
    for event in events:
        if event["event"] == "trial-kept" and event["trial"] == 2:
            event["sha256"] = "0" * 64
    text = b"".join(journal_line(event, n) for n, event in enumerate(events, 1))
    (copy / "events.jsonl").write_bytes(text)
    assert repeated_trials(find_session(data, "S002"), session) == {"T01"}


def test_kept_trials_are_hashed_by_the_given_function(session):
    hashed = []

    def digest(path):
        hashed.append(path.name)
        return sha256_of(path)

    assert compare_kept(session, digest) == []
    assert hashed == ["T01.mcap", "T02.mcap"]


def test_a_folder_that_cannot_be_read_is_a_deviation(session):
    (session.path / "trials").rename(session.path / "old")
    (session.path / "trials").symlink_to(session.path / "old")
    with pytest.raises(TrialFileError):
        session.journal_text()
    (reported,) = compare_kept(session)
    assert reported.file == "trials"
