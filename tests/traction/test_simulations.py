"""Sessions simulated from Python have the bytes of those of the command."""

import json

import pytest

import traction as tr
from acquisition.errors import SessionError, SettingsError
from tests.experiments.program import digest, traction

AUTO = ("--fake", "--fast", "--operator-script", "auto")


def files(data):
    """Digest of every file but the lock, which names its process.

    The preflight is represented by its checks without the free space of the disk, which
    other programs use, too.
    """
    paths = (p for p in data.rglob("*") if p.is_file() and p.name != ".lock")
    digests = {str(path.relative_to(data)): digest(path) for path in paths}
    for path in data.rglob("preflight.json"):
        checks = json.loads(path.read_text())["checks"]
        assert "disk" in [check["name"] for check in checks]
        fixed = [check for check in checks if check["name"] != "disk"]
        digests[str(path.relative_to(data))] = json.dumps(fixed)
    return digests


@pytest.mark.slow
def test_a_session_has_the_bytes_of_the_command(config, tmp_path, capsys):
    session = tr.simulate("TF", 1, 5, tmp_path / "own", config=config)
    assert len(session) == 1
    assert capsys.readouterr().out == ""
    numbers = ("--trials", 1, "--seed", 5)
    where = ("--config", config, "--data", tmp_path / "command")
    assert traction("run", "TF", *AUTO, *numbers, *where).code == 0
    assert files(tmp_path / "own") == files(tmp_path / "command")
    assert len(files(tmp_path / "own")) > 5


@pytest.mark.slow
def test_a_second_simulation_returns_the_new_session(config, tmp_path):
    first, second = (
        tr.simulate("TF", 1, seed, tmp_path, config=config) for seed in (1, 2)
    )
    assert first[0].name == "S001/T01"
    assert second[0].name == "S002/T01"


@pytest.mark.parametrize(
    "arguments", [("S99",), ("--help",), ("TF", 0), ("TF", "x"), ("TF", 1, -1), ("",)]
)
def test_an_invalid_simulation_is_refused(arguments, config, tmp_path):
    with pytest.raises(SettingsError):
        tr.simulate(*arguments, data=tmp_path, config=config)
    assert not list(tmp_path.rglob("*.mcap"))


@pytest.mark.slow
def test_a_simulation_next_to_an_unfinished_session_is_refused(config, tmp_path):
    options = ("--trials", 2, "--config", config, "--data", tmp_path)
    script = tmp_path / "keys"
    script.write_text("last\n")
    done = traction("run", "TF", *AUTO[:2], "--operator-script", script, *options)
    assert done.code == 5
    with pytest.raises(SessionError, match="unfinished"):
        tr.simulate("TF", 1, data=tmp_path, config=config)
