"""Analysis, package and simulation run without Linux; processes are refused."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.experiments.program import write_config

ROOT = Path(__file__).parents[1]
SLICE = Path(__file__).parent / "data" / "rehearsal_slice.npz"
NOTEBOOK = f"""
from tests.without_linux import remove
remove()
import traction as tr
tables = tr.load_tables({str(SLICE)!r})
model = tr.fit(tables.on("S0"), "tustin")
print(model)
"""


def elsewhere(*arguments, code=0):
    """Output of the program on such a system."""
    words = [sys.executable, "-m", "tests.without_linux", *map(str, arguments)]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == code, (done.stdout, done.stderr)
    return done.stdout + done.stderr


@pytest.mark.slow
def test_the_package_fits_tables():
    words = [sys.executable, "-c", NOTEBOOK]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "tustin" in done.stdout.lower()


@pytest.mark.slow
def test_tables_are_fitted_and_reported(tmp_path):
    to = tmp_path / "fit"
    elsewhere("fit", SLICE, "--to", to, "--models", "tustin")
    assert set(json.loads((to / "fits.json").read_text())["terrains"]) == {
        "S0",
        "B0",
        "TF",
    }


@pytest.mark.slow
def test_processes_are_refused_with_the_cause(tmp_path):
    asked = ("run", "S0", "--fake", "--processes", "--trials", 1, "--data", tmp_path)
    output = elsewhere(*asked, "--operator-script", "auto", code=3)
    assert "need Linux" in output
    assert "Simulations run here with --fake" in output


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_a_session_is_simulated_verified_and_reported(tmp_path):
    data = ("--data", tmp_path)
    asked = ("run", "TF", "--fake", "--fast", "--trials", 1)
    short = ("--config", write_config(tmp_path))
    elsewhere(*asked, "--operator-script", "auto", *short, *data)
    assert "every kept trial is unchanged" in elsewhere("verify", "--all", *data)
    assert "S001" in elsewhere("status", *data)
    elsewhere("export", "S001", "--to", tmp_path / "tables", *data)
    elsewhere("report", "S001", "--models", "tustin", *data)
