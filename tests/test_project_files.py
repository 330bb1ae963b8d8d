"""Files of the project that other programs read say the same as the project."""

import tomllib
from pathlib import Path

import yaml

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def parsed(name):
    return yaml.safe_load((ROOT / name).read_text())


def test_a_citation_names_the_version_that_is_released():
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


def test_a_problem_is_reported_with_the_page_of_the_rig():
    fields = parsed(".github/ISSUE_TEMPLATE/problem.yml")["body"]
    labels = [field["attributes"]["label"] for field in fields]
    assert "Output of `traction check --json`" in labels
