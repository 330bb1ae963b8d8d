"""No disturbance of a trial passes in silence, unless a number says it is harmless."""

import pytest

from tests.disturbances.measure import recorded_trial, see_recording, see_table
from tests.disturbances.rows import RECORDINGS, TABLES, Outcome


@pytest.fixture(scope="module")
def source():
    with recorded_trial() as path:
        yield path


def check(row, seen):
    assert seen.outcome is row.outcome, seen
    if row.outcome is Outcome.HARMLESS:
        assert seen.changed <= row.word + 1e-9
    else:
        assert row.word in seen.words


@pytest.mark.parametrize("row", TABLES, ids=lambda row: row.name)
def test_a_disturbed_table_is_refused_flagged_or_harmless(row):
    check(row, see_table(row))


@pytest.mark.parametrize("row", RECORDINGS, ids=lambda row: row.name)
def test_a_disturbed_recording_is_refused_flagged_or_harmless(row, source):
    check(row, see_recording(row, source))
