"""Recordings of format 1.0 stay readable, and a seed keeps its recording."""

import json
import tarfile
from pathlib import Path

import numpy as np
import pytest

from acquisition.trial_file.reader import TrialReader
from acquisition.trial_file.recover import recover_file
from tests.experiments.cycle_digest import KEPT, digests_in_process
from tests.experiments.program import journal, only_session, traction

RECORDED = Path(__file__).parents[1] / "data" / "recorded"
# Two trials of three on TF; the configuration is in the folder of the session.
SESSION = RECORDED / "session-1.0.tar.xz"


@pytest.fixture
def recorded(tmp_path):
    """The data folder and the rig.toml of the recorded session."""
    with tarfile.open(SESSION) as archive:
        archive.extractall(tmp_path, filter="data")
    folder = only_session(tmp_path)
    (tmp_path / "rig.toml").write_bytes((folder / "config.toml").read_bytes())
    (tmp_path / "matrix.toml").write_bytes((folder / "matrix.toml").read_bytes())
    return tmp_path, tmp_path / "rig.toml"


@pytest.mark.slow
def test_one_seed_always_records_the_same_cycles(tmp_path):
    kept = json.loads(KEPT.read_text())
    result = digests_in_process(tmp_path)
    if result["processor"] != kept["processor"]:
        pytest.skip(f"no kernels of a {kept['processor']} processor on this one")
    assert result["digests"] == kept["digests"]


def test_a_session_of_format_1_0_is_counted(recorded):
    data, config = recorded
    done = traction("status", "--json", "--data", data, "--config", config)
    assert done.code == 0
    rows = [row for row in json.loads(done.out) if row["is_simulated"]]
    assert [(row["terrain"], row["kept"]) for row in rows if row["kept"]] == [("TF", 2)]


def test_a_session_of_format_1_0_is_verified(recorded):
    data, config = recorded
    arguments = ("verify", "--all", "--data", data, "--config", config)
    assert traction(*arguments).code == 0
    path = only_session(data) / "trials" / "T01.mcap"
    path.unlink()
    done = traction(*arguments)
    assert done.code == 6
    assert path.name in done.err


def test_cycles_of_format_1_0_are_complete(recorded):
    path = only_session(recorded[0]) / "trials" / "T01.mcap"
    cycles = TrialReader(path).cycles().data
    assert np.all(np.diff(cycles["cycle"]) == 1)
    asked = cycles[cycles["arm_ns"] > 0]
    assert len(asked) > 0.9 * len(cycles)
    assert (asked["arm_ns"] > asked["host_ns"]).all()
    assert np.isfinite(cycles["traction"][-1]).all()


def test_a_truncated_trial_of_format_1_0_is_recovered(recorded):
    path = only_session(recorded[0]) / "trials" / "T01.mcap"
    whole = len(TrialReader(path).cycles().data)
    path.write_bytes(path.read_bytes()[: path.stat().st_size * 2 // 3])
    recovery = recover_file(path)
    trial = TrialReader(recovery.path)
    kept = len(trial.cycles().data)
    assert 0 < kept < whole
    assert trial.metadata["result"]["cycles_written"] == str(kept)


@pytest.mark.slow
def test_a_session_of_format_1_0_is_reported(recorded):
    data, config = recorded
    done = traction("report", "S001", "--data", data, "--config", config)
    assert done.code == 0, done.err
    assert (only_session(data) / "report" / "index.html").stat().st_size > 100_000


@pytest.mark.slow
def test_a_session_of_format_1_0_is_resumed_and_completed(recorded):
    data, config = recorded
    done = traction(
        *("resume", "S001", "--operator-script", "auto"),
        *("--data", data, "--config", config),
    )
    assert done.code == 0, done.out + done.err
    assert journal(only_session(data))[-1]["event"] == "session-ended"
    assert (only_session(data) / "trials" / "T03.mcap").exists()
