"""Every pinned package is in the table of licences, with the version that is pinned."""

import re

import pytest

from tests.licences import ROOT, licence_of, pins

CONSTRAINTS = (ROOT / "constraints.txt").read_text()
PEERS = {"gpy", "tinygp"}  # of benchmarks alone: docs/measured.md has their versions
ROWS = [
    tuple(cell.strip() for cell in line.strip("|").split("|"))
    for line in (ROOT / "docs" / "licences.md").read_text().splitlines()
    if line.startswith("| ") and "| version |" not in line
]


def test_every_pinned_package_has_its_line_and_no_other():
    assert {(name, version) for name, version, _ in ROWS} == set(
        pins(CONSTRAINTS).items()
    )


def test_every_line_names_a_licence():
    assert [row for row in ROWS if not row[2] or row[2] == "not declared"] == []


@pytest.mark.parametrize("row", ROWS[:3], ids=lambda row: row[0])
def test_a_line_says_what_the_package_says(row):
    assert row[2] == licence_of(row[0])


def test_every_dependency_of_the_project_is_pinned():
    text = (ROOT / "pyproject.toml").read_text()
    named = re.findall(r'^    "([A-Za-z0-9-]+)>=', text, re.MULTILINE)
    every = {**pins(CONSTRAINTS), **pins((ROOT / "docs/constraints.txt").read_text())}
    pinned = {name.lower().replace("_", "-") for name in every}
    assert len(named) > 20
    assert {name.lower() for name in named} - PEERS <= pinned
