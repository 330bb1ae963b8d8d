"""`traction init` writes valid settings and overwrites nothing."""

from importlib import resources

import pytest

from experiments.settings.load import load_settings
from tests.experiments.program import traction


def test_both_files_are_valid_and_keep_their_comments(tmp_path):
    done = traction("init", tmp_path / "lab")
    assert done.code == 0, done.err
    for name in ("rig.toml", "matrix.toml"):
        shipped = (resources.files("experiments.data") / name).read_text()
        assert (tmp_path / "lab" / name).read_text() == shipped
        assert "#" in shipped
    settings = load_settings(tmp_path / "lab" / "rig.toml")
    assert settings.matrix == load_settings(None).matrix
    checked = traction(
        "check", "--config-only", "--config", tmp_path / "lab" / "rig.toml"
    )
    assert checked.code == 0


@pytest.mark.parametrize("there", ["rig.toml", "matrix.toml"])
def test_nothing_is_overwritten(tmp_path, there):
    (tmp_path / there).write_text("mine")
    done = traction("init", tmp_path)
    assert done.code == 2
    assert there in done.err
    assert [path.name for path in tmp_path.iterdir()] == [there]
    assert (tmp_path / there).read_text() == "mine"


def test_the_crosses_in_the_comments_are_valid(tmp_path):
    assert traction("init", tmp_path).code == 0
    matrix = tmp_path / "matrix.toml"
    lines = matrix.read_text().splitlines()
    begin = lines.index("# [[crosses]]")
    cross = [line.removeprefix("# ") for line in lines[begin : begin + 5]]
    matrix.write_text("\n".join([*lines, *cross]))
    rig = tmp_path / "rig.toml"
    place = "\n[places.level]\nfar_end = [0.7, 0.0, 0.12]\ntravel = 0.45\n"
    rig.write_text(rig.read_text() + place)
    names = [row.name for row in load_settings(rig).matrix.terrains]
    assert names[-6:] == ["G12t", "G19t", "G37t", "G12b", "G19b", "G37b"]
