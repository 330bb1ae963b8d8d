"""The bill of materials has every pinned package, with the checksums of the lock."""

import sys
from importlib import metadata

from tests.licences import ROOT, pins
from tests.pylock import is_wanted, pinned
from tests.sbom import bill, hashes

CONSTRAINTS = (ROOT / "constraints.txt").read_text()
LOCK = (ROOT / "constraints.lock").read_text()


def test_the_lock_pins_what_the_constraints_pin():
    assert pins(LOCK.replace(" \\", "")) == pins(CONSTRAINTS)


def test_every_pin_of_the_lock_has_a_checksum():
    assert [name for name in pins(CONSTRAINTS) if not hashes(LOCK).get(name)] == []


def test_the_bill_names_every_pinned_package_in_its_installed_version():
    made = bill(CONSTRAINTS, LOCK)
    assert made["bomFormat"] == "CycloneDX"
    versions = {part["name"]: part["version"] for part in made["components"]}
    wanted = [
        pin for pin in pinned(CONSTRAINTS) if is_wanted(pin, sys.version_info[:2])
    ]
    assert versions == {pin.name: metadata.version(pin.name) for pin in wanted}
    assert all(part["hashes"] and part["purl"] for part in made["components"])
