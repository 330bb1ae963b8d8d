"""A bundle holds what a stranger needs, hides what it has to, and believes nothing."""

import json
import struct
import zipfile
from contextlib import suppress

import pytest

from acquisition.errors import TrialFileError
from acquisition.recording.recorder import seal
from acquisition.trial_file.writer import FLIGHT_TOPICS
from experiments.report import bundle_story
from experiments.report.bundle import HIDDEN, MANIFEST, write_bundle
from experiments.report.bundle_story import read_bundle, story
from experiments.session.data_files import journal_line, line_faults
from experiments.session.store import find_session
from tests.acquisition.trials import make_cycles, write_trial
from tests.corpus.used_session import lay_out
from tests.experiments.program import traction


@pytest.fixture
def data(tmp_path):
    """Return data with a small session that has a flight recording."""
    lay_out(tmp_path)
    folder = find_session(tmp_path, "S001").path
    (folder / "faults").mkdir(exist_ok=True)
    flight = folder / "faults" / "T03.flight.mcap"
    seal(write_trial(flight, make_cycles(1000), topics=FLIGHT_TOPICS), "estop")
    (folder / "preflight.json").write_text(
        json.dumps(
            {
                "checks": [
                    {"mark": "✔", "name": "bus", "text": "can0"},
                    {"mark": "▲", "name": "code", "text": "changed"},
                ]
            }
        )
    )
    return tmp_path


def bundled(data, *others, **options):
    """Return the bundle that is written, read again."""
    to = data / "S001.bundle.zip"
    options = {"is_redacted": False, **options}
    contents = write_bundle(find_session(data, "S001"), to, others, **options)
    return contents, read_bundle(to)


def test_what_happened_can_be_read_from_it(data):
    log = data / "bus.log"
    log.write_text("(1.000000) can0 404#30\n")
    contents, bundle = bundled(data, log)
    assert contents.left_out == {}
    assert "others/1_bus.log" in bundle.files
    lines = list(story(bundle))
    assert lines[0] == "Session S001 on TF, SIMULATED"
    assert "Preflight: 1 of 2 good" in lines
    assert "  ▲ code  changed" in lines
    assert any("trial-kept" in line for line in lines)
    last = lines[lines.index("Before the end of faults/T03.flight.mcap:") + 2 :]
    assert len(last) == 10
    assert last[-1].split()[0] == "0.0"


def test_the_last_seconds_are_those_of_the_recording(data):
    _, bundle = bundled(data)
    rows = bundle.manifest["last_seconds"]["faults/T03.flight.mcap"]
    cycles = make_cycles(1000)
    F_n = cycles["traction"][-1][2]
    assert rows[-1]["F_n"] == pytest.approx(F_n, abs=1e-4)
    fastest = abs(cycles["velocity"][-100:]).max()
    assert rows[-1]["speed"] == pytest.approx(fastest, abs=1e-4)
    assert [row["mode"] for row in rows] == [2] * 10


def test_names_and_notes_are_hidden(data):
    folder = find_session(data, "S001").path
    before = (folder / "events.jsonl").read_text()
    assert '"who": "mk"' in before
    contents, bundle = bundled(data, is_redacted=True)
    assert contents.left_out["faults/T03.flight.mcap"] == "may hold names"
    assert set(bundle.files) >= {"events.jsonl", "session.json", "trials/T01.json"}
    for name, content in bundle.files.items():
        assert b'"mk"' not in content, name
    journal = bundle.files["events.jsonl"]
    assert line_faults(journal) == []
    assert HIDDEN in journal.decode()
    assert "names and notes hidden" in "\n".join(story(bundle))
    assert any("T03.flight" in line for line in story(bundle))  # its last seconds


def test_what_a_redacted_bundle_is_for_stays_in_it(data):
    """The preflight's own words, and settings without comments."""
    folder = find_session(data, "S001").path
    checks = [
        {"mark": "▲", "name": "config", "text": "/home/ada/lab/rig.toml, TF"},
        {"mark": "✘", "name": "bus", "text": "can0 is down"},
    ]
    (folder / "preflight.json").write_text(json.dumps({"checks": checks}))
    text = '# of Ada\n[can]\nchannel = "a#b"  # Ada\'s "own"\n'
    (folder / "config.toml").write_text(text)
    (folder / "matrix.toml").write_text('a = """\n# not a comment\n"""  # Ada\n')
    contents, bundle = bundled(data, is_redacted=True)
    lines = list(story(bundle))
    assert "  ✘ bus  can0 is down" in lines
    assert f"  ▲ config  {HIDDEN}" in lines
    assert bundle.files["config.toml"].split() == b'[can] channel = "a#b"'.split()
    assert contents.left_out["matrix.toml"] == "may hold names"
    assert not any(b"Ada" in content for content in bundle.files.values())


def test_a_typed_reason_is_hidden_and_a_stop_is_not(data):
    folder = find_session(data, "S001").path
    journal = folder / "events.jsonl"
    events = [
        {"event": "trial-rejected", "trial": 1, "reason": "interrupted: estop"},
        {"event": "verdict-changed", "trial": 1, "reason": "Ada leant on it"},
    ]
    journal.write_bytes(b"".join(journal_line(e, i) for i, e in enumerate(events, 1)))
    sidecar = folder / "trials" / "T01.json"
    fields = {"history": [{"reason": "Ada leant on it"}], "stop_reason": "travel"}
    sidecar.write_text(json.dumps(fields))
    _, bundle = bundled(data, is_redacted=True)
    assert b"interrupted: estop" in bundle.files["events.jsonl"]
    assert b"travel" in bundle.files["trials/T01.json"]
    assert not any(b"Ada" in content for content in bundle.files.values())


def test_files_of_one_name_and_links_that_a_person_names_are_taken(data):
    for name in ("a", "b"):
        (data / name).mkdir()
        (data / name / "bus.log").write_text(name)
    (data / "link.log").symlink_to(data / "a" / "bus.log")
    named = [data / "a/bus.log", data / "b/bus.log", data / "link.log"]
    _, bundle = bundled(data, *named)
    found = {n: c for n, c in bundle.files.items() if n.startswith("others/")}
    assert found == {
        "others/1_bus.log": b"a",
        "others/2_bus.log": b"b",
        "others/3_link.log": b"a",
    }


def test_what_is_too_large_is_left_out_by_name(data, monkeypatch):
    monkeypatch.setattr("experiments.report.bundle.LARGEST", 50_000)
    contents, bundle = bundled(data)
    why = contents.left_out["faults/T03.flight.mcap"]
    assert why.startswith("is larger than")
    assert f"Not in the bundle: faults/T03.flight.mcap ({why})" in list(story(bundle))


def test_a_link_is_not_followed_out_of_the_session(data):
    folder = find_session(data, "S001").path
    (data / "secret").write_text("secret")
    (folder / "config.toml").unlink(missing_ok=True)
    (folder / "config.toml").symlink_to(data / "secret")
    contents, bundle = bundled(data)
    assert "config.toml" in contents.left_out
    assert "config.toml" not in bundle.files


def test_a_bundle_is_never_overwritten(data):
    bundled(data)
    with pytest.raises(TrialFileError, match="exists and is never") as refused:
        bundled(data)
    assert refused.value.hint.startswith("Choose another name.")


def test_a_torn_journal_is_told_as_one(data):
    journal = find_session(data, "S001").path / "events.jsonl"
    journal.write_bytes(journal.read_bytes()[:-20])
    _, bundle = bundled(data)
    assert any("1 of 12 lines are damaged" in line for line in story(bundle))


def test_the_command_writes_and_shows_it(data, tmp_path):
    to = tmp_path / "help.zip"
    done = traction("bundle", "S001", "--to", to, "--data", data)
    assert done.code == 0, done.err
    shown = traction("replay", "--bundle", to)
    assert shown.code == 0, shown.err
    assert "Session S001 on TF" in shown.out
    missing = traction("bundle", "S001", tmp_path / "no.log", "--data", data)
    assert missing.code == 2
    assert "no.log" in missing.err
    assert traction("replay", "S001", "--bundle", to).code == 2


# --- archives that are none, or hostile -----------------------------------------------


def manifest(**changes):
    return json.dumps({"schema": 1, "session": "S001", **changes}).encode()


def archive(path, members, compression=zipfile.ZIP_DEFLATED):
    with zipfile.ZipFile(path, "w", compression) as made:
        for name, content in members:
            made.writestr(name, content)
    return path


@pytest.mark.parametrize("content", [b"", b"no archive", b"PK\x03\x04" + bytes(40)])
def test_a_file_that_is_no_archive_is_refused(tmp_path, content):
    path = tmp_path / "a.zip"
    path.write_bytes(content)
    with pytest.raises(TrialFileError, match="is no bundle"):
        read_bundle(path)


@pytest.mark.parametrize("content", [b"[]", b"{}", b'{"schema": 2}', b"\xff"])
def test_an_archive_without_a_manifest_is_refused(tmp_path, content):
    path = archive(tmp_path / "a.zip", [(MANIFEST, content)])
    with pytest.raises(TrialFileError, match="missing or of another version"):
        read_bundle(path)


def test_an_archive_that_unpacks_to_too_much_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(bundle_story, "LARGEST", 1000)
    path = archive(tmp_path / "a.zip", [(MANIFEST, manifest()), ("big", bytes(1001))])
    with pytest.raises(TrialFileError, match="unpacks to more"):
        read_bundle(path)


def test_an_archive_of_too_many_files_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(bundle_story, "_MOST_FILES", 2)
    members = [(MANIFEST, manifest()), ("a", b""), ("b", b"")]
    with pytest.raises(TrialFileError, match="more than 2 files"):
        read_bundle(archive(tmp_path / "a.zip", members))


@pytest.mark.parametrize("at", range(0, 200, 7))
def test_a_damaged_archive_is_read_or_refused(tmp_path, at):
    path = archive(tmp_path / "a.zip", [(MANIFEST, manifest()), ("x", b"abc" * 50)])
    content = bytearray(path.read_bytes())
    content[at % len(content)] ^= 0x41
    path.write_bytes(content)
    with suppress(TrialFileError):  # nothing else is raised
        assert list(story(read_bundle(path)))


def test_an_encrypted_archive_is_refused(tmp_path):
    path = archive(tmp_path / "a.zip", [(MANIFEST, manifest())])
    content = bytearray(path.read_bytes())
    for mark, offset in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        at = content.index(mark) + offset
        content[at : at + 2] = struct.pack("<H", 1)
    path.write_bytes(content)
    with pytest.raises(TrialFileError, match="is no bundle"):
        read_bundle(path)


@pytest.mark.parametrize(
    "fields",
    [
        {"last_seconds": 7},
        {"last_seconds": {"a": 7}},
        {"last_seconds": {"a": [7, {"t": "x", "mode": "y"}, {"mode": 10**30}]}},
        {"left_out": [1]},
        {"session": {"a": 1}, "terrain": None, "simulated": "yes"},
        {"made_utc": "\x1b[2J" + "x" * 5000},
    ],
)
def test_nonsense_in_a_manifest_is_plain_text(tmp_path, fields):
    members = [
        (MANIFEST, manifest(**fields)),
        ("events.jsonl", b'{"event": 7, "utc": 8}\nnonsense\n{"utc": "2027"}\n'),
        ("preflight.json", b'{"checks": [1, {"mark": 2}]}'),
        ("provenance.json", b'{"arm:": [1], "software": {}}'),
    ]
    lines = list(story(read_bundle(archive(tmp_path / "a.zip", members))))
    assert lines[0].startswith("Session ")
    assert all(line.isprintable() and len(line) <= 160 for line in lines)
