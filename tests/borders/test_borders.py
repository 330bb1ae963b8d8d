"""Nothing foreign is read wrongly or in silence; the table says what happens."""

import resource
import warnings

import pytest

from tests.borders.row import Outcome
from tests.borders.table import SUBJECTS, text

MOST_KB = 500_000  # that a row may add to the most memory ever held
ROWS = [(subject, row) for subject, rows in SUBJECTS.items() for row in rows]


@pytest.mark.timeout(60)
@pytest.mark.parametrize(("subject", "row"), ROWS, ids=[str(row) for _, row in ROWS])
def test_what_is_given_is_read_exactly_flagged_or_refused(subject, row, tmp_path):
    before_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        answer = row.act(tmp_path)
    after_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert after_kb - before_kb < MOST_KB
    assert answer.outcome is row.outcome, answer.words
    assert row.says in answer.words


def test_no_row_may_be_read_wrongly():
    assert all(row.outcome is not Outcome.WRONG for _, row in ROWS)


def test_what_is_flagged_or_refused_by_a_file_says_its_cause():
    silent = [
        row.given
        for subject, row in ROWS
        if row.outcome is not Outcome.READ and not row.says
    ]
    assert silent == []


def test_no_row_stands_there_twice():
    assert len({row.given for _, row in ROWS}) == len(ROWS)


def test_the_printed_table_has_every_row():
    printed = [line for line in text().splitlines() if line.startswith("| ")]
    assert len(printed) == len(ROWS) + 2 * len(SUBJECTS)
