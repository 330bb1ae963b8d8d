"""The program runs with closed streams, full disks and files of other editors."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from experiments.settings.load import load_settings
from tests.experiments.program import traction, write_config

ROOT = Path(__file__).parents[2]
CLOSED = {"stdin": 0, "stdout": 1, "stderr": 2}


def started(tmp_path, *arguments, closed=(), full=False):
    """Run the program with standard streams closed, or with output to a full disk."""
    command = [sys.executable, "-m", "traction", *map(str, arguments)]
    redirections = " ".join(f"{CLOSED[name]}>&-" for name in closed)
    if full:
        redirections += " > /dev/full"
    return subprocess.run(
        ["bash", "-c", f'exec "$@" {redirections}', "start", *command],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "TMPDIR": str(tmp_path)},
    )


def test_status_works_without_streams(tmp_path):
    done = started(tmp_path, "status", "--data", tmp_path, closed=CLOSED)
    assert done.returncode == 0
    assert [path.name for path in tmp_path.iterdir()] == []  # no log of a bug


@pytest.mark.slow
@pytest.mark.timeout(120)
def test_a_session_without_streams_is_recorded(tmp_path):
    data = tmp_path / "data"
    done = started(
        tmp_path,
        *("run", "S0", "--fake", "--fast", "--trials", 1, "--data", data),
        *("--operator-script", "auto", "--config", write_config(tmp_path)),
        closed=CLOSED,
    )
    assert done.returncode == 0, done.stderr
    assert len(list(data.glob("sessions/*/trials/T01.mcap"))) == 1


@pytest.mark.wall_clock
def test_processes_keep_their_memory_without_streams(tmp_path):
    done = started(tmp_path, "check", "--fake", "--processes", closed=CLOSED)
    assert done.returncode == 0
    assert not list(tmp_path.glob("traction-bug-*"))


@pytest.mark.parametrize(
    "arguments",
    [
        ("--version",),
        ("--help",),
        ("run", "--help"),
        (),
        ("status",),
        ("status", "--json"),
        ("check", "--config-only"),
    ],
    ids=" ".join,
)
def test_output_to_a_full_disk_is_reported(tmp_path, arguments):
    done = started(tmp_path, *arguments, full=True)
    assert done.returncode == 6
    assert "The output cannot be written (No space left on device)." in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.slow
@pytest.mark.timeout(120)
def test_a_session_without_output_ends_unfinished(tmp_path):
    data = tmp_path / "data"
    done = started(
        tmp_path,
        *("run", "S0", "--fake", "--fast", "--trials", 1, "--data", data),
        *("--operator-script", "auto", "--config", write_config(tmp_path)),
        full=True,
    )
    assert done.returncode == 5, done.stderr
    assert done.stderr.count("The output cannot be written") == 1
    assert started(tmp_path, "verify", "--all", "--data", data).returncode == 0


def test_a_byte_order_mark_of_a_settings_file_is_ignored(tmp_path):
    config = write_config(tmp_path)
    text = config.read_bytes()
    config.write_bytes(b"\xef\xbb\xbf" + text)
    assert load_settings(config).rig_text.encode() == text


def test_an_error_names_the_given_file(tmp_path):
    config = write_config(tmp_path)
    other = config.rename(config.with_name("arm-2.toml"))
    other.write_text(other.read_text() + "\n[nothing]\n")
    done = traction("check", "--config-only", "--config", other)
    assert done.code == 2
    assert done.err.startswith("arm-2.toml: ")
    assert "rig.toml" not in done.err


def test_a_removed_working_folder_is_reported(tmp_path):
    command = 'mkdir gone && cd gone && rmdir ../gone && exec "$@"'
    done = subprocess.run(
        ["bash", "-c", command, "start", sys.executable, "-m", "traction", "status"],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
        env={**os.environ, "TMPDIR": str(tmp_path), "PYTHONPATH": str(ROOT)},
    )
    assert done.returncode == 2
    assert "The working directory is missing" in done.stderr
    assert list(tmp_path.iterdir()) == []  # no log of a bug
