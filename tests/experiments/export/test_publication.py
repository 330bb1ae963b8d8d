"""A published study is a crate that others can validate, check and rebuild."""

import csv
import io
import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from acquisition.errors import SettingsError
from experiments.export.crate import (
    METADATA,
    RecordingAction,
    StudyAction,
    crate_text,
)
from experiments.export.credits import LICENCES, Author, Credits
from experiments.export.rebuilding import compare_tables
from tests.experiments.program import digest, only_session, traction

ROOT = Path(__file__).parents[3]
VALIDATOR = ROOT / ".venv-crate" / "bin" / "python"
AUTHOR = ("--author", "Doe, Jane <0000-0002-1825-0097>", "--licence", "CC-BY-4.0")
PROFILE = "https://w3id.org/ro/wfrun/process/0.5"


RECORDED = ("T01.mcap", "T02.mcap")


def entities(text):
    return {entity["@id"]: entity for entity in json.loads(text)["@graph"]}


# --- a crate of a few files -----------------------------------------------------------


@pytest.fixture(scope="module")
def small_crate(tmp_path_factory):
    """A folder of six files with its metadata."""
    folder = tmp_path_factory.mktemp("crate")
    for name in ("config.toml", *RECORDED, "fits.csv", "LICENSE.md"):
        (folder / name).write_text(name)
    about = Credits(
        title="Two trials",
        description="Two trials on a plate.",
        authors=[Author("Doe, Jane", "0000-0002-1825-0097")],
        licence=LICENCES["CC0-1.0"],
        date="2027-03-14",
        software="traction 0.1.0",
    )
    recordings = [
        RecordingAction(
            name=f"S001/{trial}",
            terrain="TF",
            operator="mk",
            started_utc="2027-03-14T10:14:05Z",
            seconds=21.3,
            software="traction 0.1.0",
            commit=commit,
            settings=["config.toml"],
            results=[f"{trial}.mcap"],
        )
        for trial, commit in (("T01", "0123456789" * 4), ("T02", "unknown"))
    ]
    study = StudyAction(
        ended_utc="2027-03-15T08:00:00Z",
        software="traction 0.1.0",
        commit="unknown",
        inputs=["T01.mcap", "T02.mcap"],
        results=["fits.csv"],
    )
    text = crate_text(folder, about, recordings, study)
    (folder / METADATA).write_text(text)
    return folder


def test_every_file_of_a_crate_has_its_checksum(small_crate):
    by_id = entities((small_crate / METADATA).read_text())
    files = {k: e for k, e in by_id.items() if e["@type"] == "File"}
    assert set(files) == {p.name for p in small_crate.iterdir()} - {METADATA}
    for name, entity in files.items():
        assert entity["sha256"] == digest(small_crate / name)
        assert entity["contentSize"] == str((small_crate / name).stat().st_size)


def test_a_crate_names_profile_licence_and_author(small_crate):
    root = entities((small_crate / METADATA).read_text())["./"]
    assert root["conformsTo"] == {"@id": PROFILE}
    assert root["license"] == {"@id": LICENCES["CC0-1.0"].url}
    assert root["author"] == {"@id": "https://orcid.org/0000-0002-1825-0097"}
    assert root["datePublished"] == "2027-03-14"


def test_every_recording_is_an_action_with_tool_times_and_files(small_crate):
    by_id = entities((small_crate / METADATA).read_text())
    first, second = by_id["#trial-S001-T01"], by_id["#trial-S001-T02"]
    assert first["startTime"] == "2027-03-14T10:14:05+00:00"
    assert first["endTime"] == "2027-03-14T10:14:26+00:00"
    assert first["object"] == {"@id": "config.toml"}
    assert first["result"] == {"@id": "T01.mcap"}
    assert first["instrument"] == {"@id": f"swh:1:rev:{'0123456789' * 4}"}
    assert second["instrument"]["@id"].startswith("urn:uuid:")
    mentioned = {entity["@id"] for entity in by_id["./"]["mentions"]}
    assert mentioned == {"#trial-S001-T01", "#trial-S001-T02", "#study"}


# --- results compared -----------------------------------------------------------------

HEADER = "terrain,model,fold,quantity,value,unit\n"
TABLE = HEADER + "TF,tustin,1,mae,0.5,N\nTF,tustin,2,mae,nan,N\nTF,gp_se,1,mae,0.0,N\n"


def test_equal_tables_do_not_differ():
    result = compare_tables(TABLE, TABLE)
    assert (result.rows, result.worst, list(result.different)) == (3, 0.0, [])


@pytest.mark.parametrize(("factor", "differs"), [(1 + 4e-10, False), (1 + 3e-9, True)])
def test_a_number_may_differ_by_rounding_only(factor, differs):
    again = TABLE.replace("0.5", repr(0.5 * factor))
    result = compare_tables(TABLE, again)
    assert bool(result.different) is differs
    assert result.worst == pytest.approx(factor - 1, rel=1e-3)
    if differs:
        assert "TF tustin 1 mae N" in result.different[0]


@pytest.mark.parametrize(
    "again",
    [
        TABLE.rpartition("TF")[0],
        TABLE + "TF,x,1,mae,1.0,N\n",
        TABLE.replace("nan", "0.1"),
        TABLE.replace("tustin,1", "tustin,3"),
        TABLE.replace("0.0,N", "1e-6,N"),
    ],
)
def test_a_missing_new_or_changed_row_is_a_difference(again):
    assert compare_tables(TABLE, again).different


@pytest.mark.parametrize("text", ["a,b\n1,2\n", TABLE.replace("0.5", "much")])
def test_an_invalid_table_of_results_is_refused(text):
    with pytest.raises(SettingsError, match=r"fits\.csv"):
        compare_tables(text, TABLE)


# --- the command ----------------------------------------------------------------------


def test_without_rocrate_the_extra_is_reported_and_nothing_written(
    recorded, tmp_path, monkeypatch
):
    monkeypatch.setitem(sys.modules, "rocrate", None)
    monkeypatch.setitem(sys.modules, "rocrate.rocrate", None)
    to = tmp_path / "crate"
    done = traction("publish", "S001", "--to", to, *AUTHOR, "--data", recorded.data)
    assert done.code == 2
    assert "traction[publish]" in done.err
    assert not to.exists()


def test_publishing_into_a_folder_that_is_not_empty_is_refused(recorded, tmp_path):
    (tmp_path / "mine.txt").write_text("mine")
    options = ("--to", tmp_path, *AUTHOR, "--data", recorded.data)
    done = traction("publish", "S001", *options)
    assert done.code == 2
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


@pytest.mark.parametrize(
    "options", [("--licence", "CC0-1.0"), ("--author", "Doe"), (*AUTHOR[:3], "mine")]
)
def test_author_and_licence_must_be_named(tmp_path, options):
    done = traction("publish", "S001", "--to", tmp_path / "crate", *options)
    assert done.code == 2
    assert "usage: traction publish" in done.err


def test_a_rebuild_of_a_session_is_refused(recorded):
    done = traction("verify", "S001", "--rebuild", "--data", recorded.data)
    assert done.code == 2
    assert "traction verify crate" in done.err


@pytest.fixture(scope="module")
def published(recorded, tmp_path_factory):
    folder = tmp_path_factory.mktemp("published")
    data, to = folder / "data", folder / "crate"
    shutil.copytree(recorded.data, data)
    session = only_session(data)
    for path in session.glob("trials/T01.*"):  # as a kill leaves a trial kept again
        path.rename(session / "rejected" / path.name.replace("T01", "T01a"))
    done = traction("publish", "S001", "--to", to, *AUTHOR, "--data", data)
    assert done.code == 0
    assert [path.name for path in session.glob("trials/*.json")] == ["T02.json"]
    assert "name who pushed: auto" in done.out
    return to


@pytest.mark.slow
def test_a_published_session_agrees_with_its_journal(published):
    files = published.glob("sessions/*/trials/*.json")
    assert sorted(path.name for path in files) == ["T01.json", "T02.json"]
    assert list(published.glob("sessions/*/rejected/*")) == []


@pytest.mark.slow
def test_an_unchanged_publication_is_verified(published):
    done = traction("verify", published)
    assert (done.code, done.err) == (0, "")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["T02.mcap", "fits.csv", METADATA, "README.md"])
def test_one_changed_byte_of_a_publication_is_reported(published, tmp_path, name):
    copy = tmp_path / "crate"
    shutil.copytree(published, copy)
    (path,) = copy.rglob(name)
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    done = traction("verify", copy)
    assert done.code == 6
    assert f"{path.relative_to(copy)} is changed" in done.err
    changes = json.loads(traction("verify", copy, "--json").out)
    assert [change["path"] for change in changes] == [str(path.relative_to(copy))]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["T02.mcap", "T02.json", "fits.csv"])
def test_a_file_removed_with_its_checksum_is_reported_missing(
    published, tmp_path, name
):
    copy = tmp_path / "crate"
    shutil.copytree(published, copy)
    (path,) = (copy / "sessions").rglob(name) if name[0] == "T" else copy.rglob(name)
    path.unlink()
    _forget(copy, "SHA256SUMS", str(path.relative_to(copy)))
    done = traction("verify", copy)
    assert done.code == 6
    assert f"{path.relative_to(copy)} is missing" in done.err


@pytest.mark.slow
def test_a_trial_removed_with_its_description_is_reported_missing(published, tmp_path):
    copy = tmp_path / "crate"
    shutil.copytree(published, copy)
    for path in list((copy / "sessions").rglob("T02.*")):
        path.unlink()
        _forget(copy, "SHA256SUMS", str(path.relative_to(copy)))
    graph = json.loads((copy / METADATA).read_text())
    graph["@graph"] = [e for e in graph["@graph"] if "T02" not in json.dumps(e)]
    (copy / METADATA).write_text(json.dumps(graph))
    _forget(copy, "SHA256SUMS", METADATA)
    with (copy / "SHA256SUMS").open("a") as sums:
        sums.write(f"{digest(copy / METADATA)}  {METADATA}\n")
    done = traction("verify", copy)
    assert done.code == 6
    assert "trials/T02.mcap is missing" in done.err


def _forget(folder, file, name):
    """Remove the line of a file from a list of checksums."""
    lines = (folder / file).read_text().splitlines(keepends=True)
    kept = [line for line in lines if not line.endswith(f"  {name}\n")]
    assert len(kept) == len(lines) - 1
    (folder / file).write_text("".join(kept))


@pytest.mark.slow
def test_results_are_rebuilt_from_the_recordings(published):
    before = set(published.rglob("*"))
    done = traction("verify", published, "--rebuild")
    assert (done.code, done.err) == (0, "")
    rows = list(
        csv.DictReader(io.StringIO((published / "results/fits.csv").read_text()))
    )
    assert f"{len(rows)} results computed again" in done.out
    assert len(rows) > 100
    assert set(published.rglob("*")) == before


@pytest.mark.slow
def test_a_forged_result_is_reported_by_a_rebuild(published, tmp_path):
    copy = tmp_path / "crate"
    shutil.copytree(published, copy)
    table = copy / "results" / "fits.csv"
    rows = table.read_text().splitlines()
    cells = rows[1].split(",")
    cells[4] = repr(float(cells[4]) * 1.001)
    table.write_text("\n".join([rows[0], ",".join(cells), *rows[2:]]) + "\n")
    sums = (copy / "SHA256SUMS").read_text().splitlines()
    kept = [line for line in sums if not line.endswith("  results/fits.csv")]
    kept.append(f"{digest(table)}  results/fits.csv")  # the list is forged, too
    (copy / "SHA256SUMS").write_text("\n".join(kept) + "\n")
    done = traction("verify", copy, "--rebuild")
    assert done.code == 6
    assert f"{cells[0]} {cells[1]} {cells[2]} {cells[3]}" in done.err


@pytest.mark.slow
def test_a_publication_is_a_data_folder_and_its_tables_are_read(published, config):
    done = traction("verify", "--all", "--data", published)
    assert done.code == 0
    status = traction("status", "--json", "--data", published, "--config", config)
    (row,) = [row for row in json.loads(status.out) if row["kept"]]
    assert (row["terrain"], row["kept"], row["sessions"]) == ("TF", 2, ["S001"])
    import traction as tr

    recordings = tr.load_session("S001", published)
    tables = tr.load_tables(published / "tables")
    assert [t.name for t in tables] == [t.name for t in recordings]


def validated(crate):
    import rocrate

    context = Path(rocrate.__file__).parent / "data" / "ro-crate.jsonld"
    script = ROOT / "tests" / "crate_validation.py"
    done = subprocess.run(
        [VALIDATOR, script, crate, context],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert done.returncode in {0, 1}, done.stderr[-2000:]
    return json.loads(done.stdout)


@pytest.mark.slow
@pytest.mark.timeout(180)
def test_the_validator_of_ro_crate_finds_nothing_required(published, tmp_path):
    if not VALIDATOR.exists():
        pytest.skip("no roc-validator: make crate-validator")
    assert validated(published) == []
    copy = tmp_path / "crate"
    shutil.copytree(published, copy)
    content = json.loads((copy / METADATA).read_text())
    for entity in content["@graph"]:
        if entity["@id"] == "./":
            del entity["license"]
    (copy / METADATA).write_text(json.dumps(content))
    assert any("icense" in text for text in validated(copy))
