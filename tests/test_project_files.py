"""Files of the project that other programs read agree with the project."""

import re
import subprocess
import tomllib
from pathlib import Path

import pytest
import yaml

from experiments.__main__ import COMMANDS

FATAL = 128  # of git
ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def parsed(name):
    return yaml.safe_load((ROOT / name).read_text())


def test_the_citation_names_version_and_licence_of_the_project():
    citation = parsed("CITATION.cff")
    assert citation["version"] == PROJECT["version"]
    assert citation["license"] == PROJECT["license"]


def test_the_workflow_runs_everything_from_the_oldest_python_on():
    job = parsed(".github/workflows/ci.yml")["jobs"]["run"]
    versions = job["strategy"]["matrix"]["python"]
    assert f">={versions[0]}" == PROJECT["requires-python"]
    assert {"run": ".ci/run"} in job["steps"]


def test_commits_are_checked_by_the_ruff_of_the_project():
    (repository,) = parsed(".pre-commit-config.yaml")["repos"]
    assert {hook["entry"].split()[0] for hook in repository["hooks"]} == {
        ".venv/bin/ruff"
    }


def test_a_problem_report_asks_for_the_page_of_the_preflight():
    fields = parsed(".github/ISSUE_TEMPLATE/problem.yml")["body"]
    labels = [field["attributes"]["label"] for field in fields]
    assert "Output of `traction check --json`" in labels


def test_commands_and_pages_named_in_agents_md_exist():
    text = (ROOT / "AGENTS.md").read_text()
    names = re.findall(r"\]\(([^)]+)\)", text)
    assert names
    assert all((ROOT / name).is_file() for name in names)
    modules = re.findall(r"tests\.([a-z_.]+)", text)
    for module in modules:
        path = ROOT / "tests" / module.rstrip(".").replace(".", "/")
        assert path.with_suffix(".py").is_file() or (path / "__main__.py").is_file()
    never = text.partition("## Never")[2].partition("can move")[0]
    moving = set(re.findall(r"`(\w+)`", never))
    assert "commission" in moving
    assert moving < set(COMMANDS)


def test_no_file_has_conflict_markers():
    marks = r"^(<<<<<<< |>>>>>>> )"
    words = ["git", "grep", "-nIE", marks]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode == FATAL:
        pytest.skip("no checkout of git")
    assert done.stdout == ""
