"""A bundle holds a session's small files, its logs and the versions that made it."""

import json
import zipfile

import pytest

from acquisition.errors import TrialFileError
from acquisition.recording.recorder import seal
from acquisition.trial_file.writer import FLIGHT_TOPICS
from experiments.export.bundle import MANIFEST, write_bundle
from experiments.session.store import find_session
from tests.acquisition.trials import make_cycles, write_trial
from tests.corpus.used_session import lay_out
from tests.experiments.program import traction


@pytest.fixture
def data(tmp_path):
    """Data with a small session that has a flight record."""
    lay_out(tmp_path)
    folder = find_session(tmp_path, "S001").path
    (folder / "faults").mkdir(exist_ok=True)
    flight = folder / "faults" / "T03.flight.mcap"
    seal(write_trial(flight, make_cycles(1000), topics=FLIGHT_TOPICS), "estop")
    return tmp_path


def bundled(data, *others):
    """Reasons of the files left out, and the files of the archive by name."""
    to = data / "S001.bundle.zip"
    contents = write_bundle(find_session(data, "S001"), to, others)
    with zipfile.ZipFile(to) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    return contents.left_out, files


def test_a_bundle_holds_small_files_flight_records_and_named_logs(data):
    log = data / "bus.log"
    log.write_text("(1.000000) can0 404#30\n")
    left_out, files = bundled(data, log)
    assert left_out == {}
    folder = find_session(data, "S001").path
    for name in ("events.jsonl", "session.json", "faults/T03.flight.mcap"):
        assert files[name] == (folder / name).read_bytes(), name
    assert files["others/1_bus.log"] == log.read_bytes()
    assert not any(name.startswith("trials/T01.mcap") for name in files)


def test_the_manifest_names_versions_and_every_file(data):
    _, files = bundled(data)
    manifest = json.loads(files.pop(MANIFEST))
    assert manifest["session"] == "S001"
    assert manifest["versions"]["software"].startswith("traction ")
    assert {file["name"] for file in manifest["files"]} == set(files)


def test_named_files_of_equal_name_and_named_links_are_included(data):
    for name in ("a", "b"):
        (data / name).mkdir()
        (data / name / "bus.log").write_text(name)
    (data / "link.log").symlink_to(data / "a" / "bus.log")
    named = [data / "a/bus.log", data / "b/bus.log", data / "link.log"]
    _, files = bundled(data, *named)
    others = {n: c for n, c in files.items() if n.startswith("others/")}
    assert others == {
        "others/1_bus.log": b"a",
        "others/2_bus.log": b"b",
        "others/3_link.log": b"a",
    }


def test_a_file_that_is_too_large_is_left_out_and_named(data, monkeypatch):
    monkeypatch.setattr("experiments.export.bundle.LARGEST", 50_000)
    left_out, files = bundled(data)
    assert left_out["faults/T03.flight.mcap"].startswith("is larger than")
    assert json.loads(files[MANIFEST])["left_out"] == left_out


def test_a_link_is_not_followed_out_of_the_session(data):
    folder = find_session(data, "S001").path
    (data / "secret").write_text("secret")
    (folder / "config.toml").unlink(missing_ok=True)
    (folder / "config.toml").symlink_to(data / "secret")
    left_out, files = bundled(data)
    assert "config.toml" in left_out
    assert "config.toml" not in files


def test_a_bundle_is_never_overwritten(data):
    bundled(data)
    with pytest.raises(TrialFileError, match="exists and is never") as refused:
        bundled(data)
    assert refused.value.hint.startswith("Choose another name.")


def test_the_command_first_warns_of_names_and_notes(data, tmp_path):
    to = tmp_path / "help.zip"
    done = traction("bundle", "S001", "--to", to, "--data", data)
    assert done.code == 0, done.err
    assert "names and notes of the people" in done.out.splitlines()[0]
    assert zipfile.is_zipfile(to)
    missing = traction("bundle", "S001", tmp_path / "no.log", "--data", data)
    assert missing.code == 2
    assert "no.log" in missing.err
