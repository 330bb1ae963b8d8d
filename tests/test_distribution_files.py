"""Files alongside the wheel: man pages, container, workflow, and their scripts."""

import json
import os
import re
import runpy
import shutil
import subprocess
from pathlib import Path

import pytest

from experiments.__main__ import COMMANDS
from tests.experiments.program import traction, write_config

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def pages():
    return runpy.run_path(str(ROOT / "docs" / "man_pages.py"))["pages"]()


def test_every_command_has_a_page_with_all_its_options(pages):
    assert set(pages) == {"traction.1", *(f"traction-{name}.1" for name in COMMANDS)}
    for name in COMMANDS:
        text = pages[f"traction-{name}.1"].replace("\\-", "-")
        usage = traction(name, "--help").out.partition("examples:")[0]
        options = set(re.findall(r"(?<![\w-])--[a-z][a-z-]+", usage))
        assert "--help" in options
        assert {option for option in options if option not in text} == set()
        assert text.count(".SH ") == 6


@pytest.mark.skipif(shutil.which("groff") is None, reason="no groff")
def test_no_text_of_a_page_is_read_as_a_roff_request(pages):
    for name, text in pages.items():
        done = subprocess.run(
            ["groff", "-man", "-ww", "-Tutf8"],
            input=text,
            capture_output=True,
            text=True,
            check=True,
        )
        assert done.stderr == "", name


def test_a_line_that_begins_like_a_request_is_escaped():
    escaped = runpy.run_path(str(ROOT / "docs" / "man_pages.py"))["escaped"]
    assert escaped(".so /etc/passwd") == "\\&.so /etc/passwd"
    assert escaped("'x\\y-z") == "\\&'x\\ey\\-z"


def test_container_and_workflow_name_existing_targets_and_inputs():
    makefile = (ROOT / "Makefile").read_text()
    for text in ((ROOT / "Dockerfile").read_text(),):
        for target in re.findall(r"make ([a-z]+)\b(?! &&)", text):
            assert re.search(rf"^{target}:", makefile, re.MULTILINE) or target == "demo"
        assert "USER lab" in text.partition("CMD")[0]
    container = json.loads((ROOT / ".devcontainer/devcontainer.json").read_text())
    build = ROOT / ".devcontainer" / container["build"]["dockerfile"]
    assert build.resolve() == ROOT / "Dockerfile"
    workflow = (ROOT / ".github/workflows/experiment.yml").read_text()
    (script,) = re.findall(r"\.traction/(\.ci/\w+) ", workflow)
    assert os.access(ROOT / script, os.X_OK)
    inputs = set(re.findall(r"inputs\.(\w+)", workflow))
    declared = re.findall(r"^ {6}(\w+): \{ type", workflow, re.MULTILINE)
    assert inputs == set(declared)


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_another_laboratorys_matrix_is_recorded_verified_and_reported(tmp_path):
    config = write_config(tmp_path)
    program = tmp_path / "traction"
    program.write_text(
        f'#!/bin/sh\nexec "{shutil.which("traction", path=ROOT / ".venv/bin")}" "$@"\n'
    )
    program.chmod(0o755)
    environment = {**os.environ, "TRACTION": str(program)}
    script = ROOT / ".ci" / "experiment"
    done = subprocess.run(
        [script, config, tmp_path / "out", "1", "TF", "Tf"],
        env=environment,
        capture_output=True,
        text=True,
        timeout=280,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "TF: recorded\nTf: recorded\n" in done.stdout
    assert (tmp_path / "out/study/report/index.html").stat().st_size > 10_000
    wrong = subprocess.run(
        [script, config, tmp_path / "other", "1", "NONE"],
        env=environment,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert wrong.returncode != 0
    assert "FAILED: NONE" in wrong.stdout
