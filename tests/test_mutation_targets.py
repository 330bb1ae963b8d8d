"""The targets of the mutation check are files and statements that exist."""

from pathlib import Path

import pytest

from benchmarks import mutation_check
from benchmarks.mutation_targets import EQUIVALENT, TESTS

ROOT = Path(__file__).parents[1]


def test_every_module_and_its_tests_exist():
    named = {*TESTS, *(test for tests in TESTS.values() for test in tests)}
    assert [name for name in sorted(named) if not (ROOT / name).exists()] == []


@pytest.mark.long
@pytest.mark.parametrize("path", sorted({path for path, _ in EQUIVALENT}))
def test_every_equivalent_mutation_can_still_be_made(path, monkeypatch):
    monkeypatch.setattr(mutation_check, "EQUIVALENT", {})
    made = {mutation.text for mutation in mutation_check.mutations(path)}
    listed = {text for module, text in EQUIVALENT if module == path}
    assert listed - made == set()
