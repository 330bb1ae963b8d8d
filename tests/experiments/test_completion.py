"""The tab key offers commands, terrains, sessions, trials, faults and messages."""

import os
import subprocess
import sys

import pytest

from experiments.__main__ import COMMANDS
from experiments.messages import CATALOGUE
from tests.experiments.program import write_config

pytestmark = pytest.mark.slow


def offered(line, folder):
    """Words offered after `line`, as argcomplete's shell function asks."""
    answer = folder / "answer"
    environment = {
        **os.environ,
        "_ARGCOMPLETE": "1",
        "_ARGCOMPLETE_IFS": "\n",
        "_ARGCOMPLETE_STDOUT_FILENAME": str(answer),
        "COMP_LINE": line,
        "COMP_POINT": str(len(line)),
        "COMP_TYPE": "9",
    }
    done = subprocess.run(
        [sys.executable, "-m", "experiments"],
        env=environment,
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert "Traceback" not in done.stderr
    return {name.strip() for name in answer.read_text().splitlines()}


def test_commands_are_offered(tmp_path):
    assert set(COMMANDS) <= offered("traction ", tmp_path)


def test_terrains_of_the_matrix_are_offered(tmp_path):
    config = write_config(tmp_path)
    matrix = config.with_name("matrix.toml")
    matrix.write_text(matrix.read_text().replace('name = "Tf"', 'name = "Tm"'))
    assert offered(f"traction run --config {config} T", tmp_path) == {"TF", "Tm"}


def test_sessions_and_their_kept_trials_are_offered(tmp_path):
    trials = tmp_path / "data" / "sessions" / "2027-01-02_S007_TF.fake" / "trials"
    trials.mkdir(parents=True)
    (trials / "T03.mcap").touch()
    assert offered("traction redo S", tmp_path) == {"S007"}
    assert offered("traction redo S007 T", tmp_path) == {"T03"}


def test_faults_and_messages_are_offered(tmp_path):
    assert "ft-stale" in offered("traction run S0 --fake --fault ft-", tmp_path)
    names = offered("traction check --explain ", tmp_path)
    assert set(CATALOGUE) <= names


def test_unreadable_settings_offer_nothing_without_an_error(tmp_path):
    (tmp_path / "rig.toml").write_text("[cann]\n")
    assert offered("traction run --config rig.toml S", tmp_path) <= {"S"}
