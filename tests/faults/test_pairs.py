"""Two faults in succession have the stricter outcome."""

import pytest

from tests.attacks.attack import RunBy
from tests.attacks.parameters import parameters
from tests.faults.pairs import EVERY_COMMIT, every_pair, pair_attacks


@pytest.mark.parametrize(
    "row", parameters(r for r in pair_attacks() if r.run_by is RunBy.CI)
)
def test_two_faults_have_the_stricter_outcome(row, tmp_path):
    row.check(tmp_path)


def test_pairs_run_at_each_commit_are_in_the_table():
    assert {*EVERY_COMMIT} <= {*every_pair()}
