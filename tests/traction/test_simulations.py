"""Simulated sessions from Python: the bytes of the command."""

import json

import pytest

import traction as tr
from acquisition.errors import SessionError, SettingsError
from tests.experiments.program import digest, traction

AUTO = ("--fake", "--fast", "--operator-script", "auto")


def files(data):
    """Return the digest of every file but the lock, which names its process.

    Of the preflight that is the checks without the free space of the disk, which others
    use, too.
    """
    paths = (p for p in data.rglob("*") if p.is_file() and p.name != ".lock")
    found = {str(path.relative_to(data)): digest(path) for path in paths}
    for path in data.rglob("preflight.json"):
        checks = json.loads(path.read_text())["checks"]
        assert "disk" in [check["name"] for check in checks]
        known = [check for check in checks if check["name"] != "disk"]
        found[str(path.relative_to(data))] = json.dumps(known)
    return found


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
def test_a_further_session_is_the_one_that_is_returned(config, tmp_path):
    first, second = (
        tr.simulate("TF", 1, seed, tmp_path, config=config) for seed in (1, 2)
    )
    assert first[0].name == "S001/T01"
    assert second[0].name == "S002/T01"


@pytest.mark.parametrize(
    "arguments", [("S99",), ("--help",), ("TF", 0), ("TF", "x"), ("TF", 1, -1), ("",)]
)
def test_what_cannot_be_simulated_is_refused(arguments, config, tmp_path):
    with pytest.raises(SettingsError):
        tr.simulate(*arguments, data=tmp_path, config=config)
    assert not list(tmp_path.rglob("*.mcap"))


@pytest.mark.slow
def test_an_unfinished_session_is_not_touched(config, tmp_path):
    options = ("--trials", 2, "--config", config, "--data", tmp_path)
    script = tmp_path / "keys"
    script.write_text("last\n")
    done = traction("run", "TF", *AUTO[:2], "--operator-script", script, *options)
    assert done.code == 5
    with pytest.raises(SessionError, match="unfinished"):
        tr.simulate("TF", 1, data=tmp_path, config=config)
