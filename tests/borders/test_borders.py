"""No external input is read incorrectly or changed without a message."""

import pytest

from tests.attacks.parameters import parameters
from tests.borders.row import Outcome
from tests.borders.table import SUBJECTS, border_attacks

ROWS = [row for rows in SUBJECTS.values() for row in rows]


@pytest.mark.parametrize("row", parameters(border_attacks()))
def test_a_foreign_input_is_read_exactly_flagged_or_refused(row, tmp_path):
    row.check(tmp_path)


def test_no_row_expects_a_wrong_reading():
    assert all(row.outcome is not Outcome.WRONG for row in ROWS)


def test_every_flagged_or_refused_row_states_its_cause():
    silent = [r.given for r in ROWS if r.outcome is not Outcome.READ and not r.says]
    assert silent == []
