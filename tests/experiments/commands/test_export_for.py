"""`traction export --for` writes a folder per target and refuses mixed uses."""

import json

import pytest

from tests.analysis.terrains.export.databases import database_file
from tests.experiments.program import traction

FOR = ("--for", "c,onnx")


@pytest.fixture(scope="module")
def db(tmp_path_factory):
    return database_file(tmp_path_factory.mktemp("db"))


def export(db, to, *options):
    return traction("export", "--terrain-db", db, "--to", to, *options)


def test_every_target_has_its_folder(db, tmp_path):
    done = export(db, tmp_path / "made", *FOR)
    assert (done.code, done.err) == (0, "")
    assert "SIMULATED" in done.out
    folders = {path.name for path in (tmp_path / "made").iterdir()}
    assert folders == set(FOR[1].split(","))
    for folder in (tmp_path / "made").iterdir():
        source = json.loads((folder / "source.json").read_text())
        assert source["target"] == folder.name
        assert list(source["terrains"]) == ["S0", "TF"]


def test_two_runs_write_the_same_bytes(db, tmp_path):
    made = []
    for name in ("a", "b"):
        assert export(db, tmp_path / name, *FOR).code == 0
        folder = tmp_path / name
        files = sorted(p for p in folder.rglob("*") if p.is_file())
        made.append({str(p.relative_to(folder)): p.read_bytes() for p in files})
    assert made[0] == made[1]


def test_terrain_model_and_precision_are_chosen(db, tmp_path):
    options = ("--terrain", "TF", "--model", "gp_se", "--float")
    done = export(db, tmp_path / "made", "--for", "c", *options)
    assert done.code == 0
    source = json.loads((tmp_path / "made/c/source.json").read_text())
    assert list(source["terrains"]) == ["TF"]
    assert source["model"] == "gp_se"
    header = (tmp_path / "made/c/traction_terrains.h").read_text()
    assert "typedef float traction_real" in header


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--for", "c,unity"), "no target unity"),
        (("--for", "c", "--terrain", "S9"), "no terrain 'S9'"),
        (("--for", "c", "--model", "tustin"), "no model 'tustin'"),
        (("--for", "c", "--format", "csv"), "--format"),
        (("--for", "c", "--standard-rate"), "--standard-rate"),
        (("--for", "c", "--allow-missing"), "--allow-missing"),
        (("--for", "c", "S001"), "not S001"),
        ((), "Export what"),
        (("--for", "c", "--terrain", ","), "names no terrain"),
        (("--for", "onnx", "--float"), "--float is for c"),
        (("--float", "--terrain", "S0"), "--terrain, --float"),
    ],
)
def test_mixed_and_unknown_uses_are_refused(db, tmp_path, options, words):
    done = export(db, tmp_path / "made", *options)
    assert done.code == 2
    assert words in done.err
    assert "Nothing was written" in done.err or "Terrains: S0, TF" in done.err
    assert not (tmp_path / "made").exists()


def test_missing_options_and_an_unreadable_database_are_reported(db, tmp_path):
    done = traction("export", "--for", "c", "--to", tmp_path / "made")
    assert (done.code, "needs the database" in done.err) == (2, True)
    done = traction("export", "--for", "c", "--terrain-db", db)
    assert (done.code, "the folder to write" in done.err) == (2, True)
    done = export(tmp_path / "none.json", tmp_path / "made", "--for", "c")
    assert (done.code, "cannot be read" in done.err) == (2, True)


def test_a_folder_that_is_not_empty_is_left_alone(db, tmp_path):
    (tmp_path / "mine.txt").write_text("mine")
    done = export(db, tmp_path, "--for", "c")
    assert done.code == 2
    assert "not empty" in done.err
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]
