"""Everything that is pinned names its licence, and everything needed is pinned."""

import re

from tests.licences import CONSTRAINTS, ROOT, pins, table

PEERS = {"gpy", "tinygp"}  # of benchmarks alone


def test_every_pinned_package_names_a_licence():
    text = CONSTRAINTS.read_text()
    rows = table(text)
    assert {(name, version) for name, version, _ in rows} == set(pins(text).items())
    unknown = [row for row in rows if not row[2] or row[2] == "not declared"]
    assert unknown == []
    assert sum(licence == "not installed" for *_, licence in rows) < len(rows) // 10


def test_every_dependency_of_the_project_is_pinned():
    text = (ROOT / "pyproject.toml").read_text()
    named = re.findall(r'^    "([A-Za-z0-9-]+)>=', text, re.MULTILINE)
    every = {
        **pins(CONSTRAINTS.read_text()),
        **pins((ROOT / "docs/constraints.txt").read_text()),
    }
    pinned = {name.lower().replace("_", "-") for name in every}
    assert len(named) > 20
    assert {name.lower() for name in named} - PEERS <= pinned
