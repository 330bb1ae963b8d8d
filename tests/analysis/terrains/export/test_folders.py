"""Every target has a README, a source and an origin; hostile names do no harm."""

import json
import re

import pytest

from acquisition.errors import SettingsError
from analysis.terrains.export.exported import TerrainExport
from analysis.terrains.export.folder import parse_targets, target_files
from analysis.terrains.export.names import identifiers, shown, target_names
from tests.analysis.terrains.export.databases import DIGEST, database, export

HOSTILE = (
    '*/ int x; /* "\\\n#error ]]> --> <a> & ../../etc ??/',
    "../../../tmp/x\0$(rm -rf)`'\"\u202e\u0000",
)


@pytest.fixture(params=target_names())
def target(request):
    return request.param


def test_both_targets_are_exported():
    assert set(parse_targets("c,onnx")) == set(target_names())


THIRD = """
from analysis.terrains.export.folder import ExportTarget

TARGET = ExportTarget(
    "A third", lambda e: {"a.txt": e.origin.encode()}, lambda e: ("What it is.",) * 6
)
"""


def test_a_further_target_is_a_single_file(tmp_path, monkeypatch):
    from analysis.terrains.export import targets

    (tmp_path / "third.py").write_text(THIRD)
    monkeypatch.setattr(targets, "__path__", [*targets.__path__, str(tmp_path)])
    assert parse_targets("c,third") == ("c", "third")
    made = target_files("third", export())
    assert set(made) == {"a.txt", "README.md", "source.json"}
    assert made["README.md"].count(b"\n") == 10


@pytest.mark.parametrize("text", ["", "c,c", "c,unity", "../c", "__init__"])
def test_other_targets_are_refused(text):
    with pytest.raises(SettingsError, match="--for"):
        parse_targets(text)


def test_a_readme_is_short_and_states_its_origin(target):
    lines = target_files(target, export())["README.md"].decode().splitlines()
    assert len(lines) == 10
    assert lines[0].startswith("# ")
    assert DIGEST[:16] in lines[1]
    assert all(len(line) > 20 for line in lines)


def test_the_source_is_complete(target):
    source = json.loads(target_files(target, export(is_simulated=False))["source.json"])
    assert source["target"] == target
    assert source["database_sha256"] == DIGEST
    assert (source["model"], source["traction"]) == ("gp_se_trial", "1.2.3")
    assert source["simulated"] is False
    assert source["terrains"]["S0"]["trials"] == 10


def test_simulated_trials_are_reported_in_every_artefact(target):
    for path, content in target_files(target, export()).items():
        assert b"simulated" in content.lower(), path
    for path, content in target_files(target, export(is_simulated=False)).items():
        assert b"SIMULATED trials" not in content, path


def test_hostile_names_stay_harmless(target):
    for path, content in target_files(target, export(names=HOSTILE)).items():
        assert re.fullmatch(r"[A-Za-z0-9_]+([./][A-Za-z0-9_]+)*", path)
        if path.endswith((".h", ".md")):
            text = content.decode()
            assert "#error ]]" not in text
            assert "rm -rf)`" not in text


def test_hostile_names_are_preserved_in_data(target):
    source = json.loads(target_files(target, export(names=HOSTILE))["source.json"])
    assert tuple(source["terrains"]) == HOSTILE


@pytest.mark.parametrize("name", ["S0", "S 0", "", "0", "é", *HOSTILE, "x" * 500])
def test_an_identifier_is_one_word(name):
    assert re.fullmatch(r"[A-Za-z0-9_]{1,40}", identifiers([name])[name])


def test_identifiers_keep_signs_and_points_of_numbers():
    names = ("G12dt+10", "G12dt-10", "G12.5", "dry-10", "a-b")
    words = dict(
        zip(names, ("G12dtp10", "G12dtm10", "G12p5", "drym10", "a_b"), strict=True)
    )
    assert identifiers(names) == words
    assert all(identifiers([name]) == {name: word} for name, word in words.items())


@pytest.mark.parametrize("pair", [("S0", "s0"), ("a b", "a_b"), ("é", "ä")])
def test_two_names_with_one_identifier_are_refused(pair):
    with pytest.raises(SettingsError, match="are both"):
        identifiers(pair)


@pytest.mark.parametrize("text", [*HOSTILE, "", "\n", "é" * 300])
def test_displayed_text_is_one_harmless_line(text):
    assert re.fullmatch(r"[A-Za-z0-9 .,:()_+?-]{1,60}", shown(text))


def test_unknown_terrains_and_models_are_refused():
    with pytest.raises(SettingsError, match="no terrain 'X'"):
        TerrainExport.of(database(), DIGEST, "1", ("X",))
    with pytest.raises(SettingsError, match="no model 'tustin'"):
        TerrainExport.of(database(), DIGEST, "1", model="tustin")
