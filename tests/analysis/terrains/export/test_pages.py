"""Programs in the documentation compile, run and give the stated results."""

import re
import subprocess
from pathlib import Path

import pytest

from analysis.terrains.database import load
from tests.analysis.terrains.export.compiled import FLAGS, build
from tests.analysis.terrains.export.databases import database, database_file
from tests.analysis.terrains.export.written import write

DOCS = Path(__file__).parents[4] / "docs"


def block(page, language):
    """Return the one block of code of a language on a page."""
    text = (DOCS / page).read_text()
    (code,) = re.findall(rf"```{language}\n(.*?)```", text, re.DOTALL)
    return code


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write(tmp_path_factory.mktemp("pages"), "c")


def test_the_controller_example_has_its_stated_risk(folder):
    program = build(folder, block("controller.md", "c"), *FLAGS)
    rows = "5.0 0.0 0.0\n9.0 0.0 0.0\n0.0 0.0 0.0\nnan 0.0 0.0\n"
    done = subprocess.run(
        [program], input=rows, capture_output=True, text=True, check=True
    )
    asked = [float(line) for line in done.stdout.split()]
    models = [known.from_rest for known in database().terrains.values()]
    for F_n, force in zip((5.0, 9.0), asked, strict=False):
        risks = [
            sum(m.slip_risk(f, F_n).risk for m in models) / 2
            for f in (force, force + 0.11)
        ]
        assert risks[0] <= 0.05 + 1e-5
        assert risks[1] > 0.05 or force == 6.0
    assert asked[0] < asked[1] <= 6.0
    assert asked[3] == 0.0  # no force is requested at an unknown load


def test_the_controller_example_is_right_in_single_precision(tmp_path):
    folder = write(tmp_path, "c", is_float=True)
    program = build(folder, block("controller.md", "c"), *FLAGS)
    rows = "5.0 0.0 0.0\n9.0 0.0 0.0\nnan 0.0 0.0\n"
    done = subprocess.run(
        [program], input=rows, capture_output=True, text=True, check=True
    )
    asked = [float(line) for line in done.stdout.split()]
    assert 0.0 < asked[0] < asked[1] <= 6.0
    assert asked[2] == 0.0


def test_the_controller_example_is_as_short_as_stated():
    code = block("controller.md", "c")
    body = code[code.index("int main") :].splitlines()
    assert len(body) <= 30


def test_the_example_for_simulators_gives_coefficients(tmp_path, monkeypatch):
    database_file(tmp_path)
    monkeypatch.chdir(tmp_path)
    found = {}
    exec(block("controller.md", "python"), found)
    known = load(tmp_path / "terrains.json").terrain("S0")
    assert found["sliding"] == known.predict(5.0, 0.05).median / 5.0
    assert known.slip_risk(5.0 * found["static"], 5.0).risk == pytest.approx(0.5)
