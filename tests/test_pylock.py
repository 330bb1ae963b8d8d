"""The locks pin what constraints.txt pins, with a wheel for every supported Python."""

import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from tests.licences import pins
from tests.pylock import (
    PYTHONS,
    ROOT,
    fits,
    hash_lock,
    is_wanted,
    missing,
    pinned,
    pylock,
)
from tests.sbom import hashes

PINS = pinned((ROOT / "constraints.txt").read_text())
LOCK = tomllib.loads((ROOT / "pylock.toml").read_text())
SUMS = {
    Path(wheel["path"]).name: wheel["hashes"]["sha256"]
    for package in LOCK["packages"]
    for wheel in package["wheels"]
}


def test_the_locks_agree_with_the_constraints():
    assert (ROOT / "pylock.toml").read_text() == pylock(PINS, SUMS)
    assert (ROOT / "constraints.lock").read_text() == hash_lock(PINS, SUMS)
    assert {p.name for p in PINS} == set(pins((ROOT / "constraints.txt").read_text()))


def test_both_locks_have_the_same_checksums():
    other = hashes((ROOT / "constraints.lock").read_text())
    assert {s for sums in other.values() for s in sums} == set(SUMS.values())


@pytest.mark.parametrize("python", PYTHONS)
def test_every_pin_has_a_wheel_for_every_declared_python(python):
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    name = f"Programming Language :: Python :: {python[0]}.{python[1]}"
    assert name in project["classifiers"]
    assert missing(PINS, list(SUMS), python) == []


def test_a_pin_without_a_wheel_is_missing():
    pin = Requirement("thing==1.0")
    old = ["thing-1.0-cp311-cp311-manylinux2014_x86_64.whl"]
    assert missing([pin], old, (3, 11)) == []
    assert missing([pin], old, (3, 12)) == ["thing==1.0"]
    assert missing([pin], ["thing-1.1-py3-none-any.whl"], (3, 11)) == ["thing==1.0"]


@pytest.mark.parametrize(
    ("wheel", "python", "expected"),
    [
        ("a-1-py3-none-any.whl", (3, 14), True),
        ("a-1-py2-none-any.whl", (3, 14), False),
        ("a-1-cp39-abi3-manylinux_2_17_x86_64.whl", (3, 14), True),
        ("a-1-cp312-abi3-manylinux_2_17_x86_64.whl", (3, 11), False),
        ("a-1-cp313-cp313-manylinux_2_17_aarch64.whl", (3, 13), False),
        ("a-1-py3-none-manylinux_2_28_x86_64.whl", (3, 12), True),
        ("a-1-cp313-cp313-win_amd64.whl", (3, 13), False),
    ],
)
def test_wheels_are_selected_by_their_tags(wheel, python, expected):
    assert fits(wheel, python) is expected


def test_a_pin_is_wanted_by_its_marker():
    pin = Requirement('thing==1.0; python_version < "3.14"')
    assert [is_wanted(pin, python) for python in PYTHONS] == [True, True, True, False]
    assert missing([pin], [], (3, 14)) == []


def test_no_address_of_an_index_is_in_the_locks():
    for name in ("pylock.toml", "constraints.lock", "constraints.txt"):
        assert "://" not in (ROOT / name).read_text()
