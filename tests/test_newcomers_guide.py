"""The changes of the newcomer's guide are applied to a copy of the tree and tried."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
GUIDE = (ROOT / "docs" / "newcomers.md").read_text()
PACKAGES = (
    "acquisition",
    "analysis",
    "experiments",
    "fakes",
    "ft_sensor",
    "traction",
    "wam",
)
EXPECTED_OUTPUT = {
    "A terrain": r"M5 +simulated +1/1",
    "A sensor": r"Complete\.",
    "A kernel or model": r"index\.html",
    "A command": r"\blab\n(.|\n)*where +print the data folder",
    "A limit of the guard": r"The sole is 0\.\d+ m above the base \(limit 0\.10\)",
}
BLOCK = r"\n\n```\w*\n(?P<text>.*?)```"
CHANGE = re.compile(
    r"^(?:New file|At the end of|In) `(?P<file>[^`]+)`"
    r"(?:, (?P<how>below|in place of)\s+`(?P<line>[^`]+)`)?:" + BLOCK,
    re.MULTILINE | re.DOTALL,
)
TRIED = re.compile(r"^Try it:" + BLOCK, re.MULTILINE | re.DOTALL)


def recipe(title):
    """Return the part of the guide under a heading."""
    return re.split(r"^## ", GUIDE.partition(f"## {title}\n")[2], flags=re.M)[0]


@pytest.fixture
def tree(tmp_path):
    """A copy of the program's tree, with what is compiled of it."""
    for package in PACKAGES:
        shutil.copytree(ROOT / package, tmp_path / package)
    (tmp_path / "tests").mkdir()
    (tmp_path / "tests" / "data").symlink_to(ROOT / "tests" / "data")
    return tmp_path


def apply_changes(tree, title):
    """Apply every change of a recipe; return the changed files."""
    files = []
    for change in CHANGE.finditer(recipe(title)):
        path, text = tree / change["file"], change["text"]
        before = path.read_text() if path.exists() else ""
        line = change["line"]
        if line is not None:
            assert before.count(f"{line}\n") == 1, f"{change['file']}: {line}"
            new = f"{line}\n{text}" if change["how"] == "below" else text
            text = before.replace(f"{line}\n", new)
        else:
            text = before + text
        path.write_text(text)
        files.append(change["file"])
    return files


def run_commands(tree, title):
    """Run the commands of a recipe; return their output."""
    outputs = []
    scripts = tree / "bin"
    scripts.mkdir()
    (scripts / "traction").write_text(
        f'#!/bin/sh\nexec {sys.executable} -m traction "$@"\n'
    )
    (scripts / "python").write_text(f'#!/bin/sh\nexec {sys.executable} "$@"\n')
    for script in scripts.iterdir():
        script.chmod(0o755)
    path = f"{scripts}:{os.environ['PATH']}"
    environment = os.environ | {"PATH": path, "PYTHONPATH": str(tree)}
    for command in TRIED.search(recipe(title))["text"].splitlines():
        done = subprocess.run(
            ["sh", "-c", command],
            cwd=tree,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"
        outputs.append(done.stdout + done.stderr)
    return "\n".join(outputs)


def stated_file_count(title):
    """Return the number of files that the guide's table states for a recipe."""
    row = re.search(rf"^\| {title.lower()} \| (.*) \|$", GUIDE, re.MULTILINE)
    return sum(map(int, re.findall(r"\d+", row[1])))


@pytest.mark.slow
@pytest.mark.timeout(300)  # each copies the program and runs it
@pytest.mark.parametrize(("title", "word"), EXPECTED_OUTPUT.items())
def test_a_recipe_of_the_guide_works_with_the_stated_number_of_files(tree, title, word):
    files = apply_changes(tree, title)
    assert len(set(files)) == stated_file_count(title)
    assert re.search(word, run_commands(tree, title))
    if title == "A kernel or model":
        assert "GP (SE + NN)" in (tree / "fit/report/index.html").read_text()
    if title == "A sensor":
        (record,) = tree.glob("data/sessions/*/conditions.json")
        assert '"rig.ft_sensor.kind": "acme"' in record.read_text()


def test_every_recipe_of_the_guide_is_tested():
    titles = re.findall(r"^## (.*)$", GUIDE, re.MULTILINE)
    assert [*EXPECTED_OUTPUT, "Before you commit"] == titles
