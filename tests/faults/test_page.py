"""The table that people read is the one that the program is held against."""

from pathlib import Path

from tests.faults.__main__ import page

ROOT = Path(__file__).parents[2]


def test_the_printed_matrix_is_the_tested_one():
    assert (ROOT / "docs" / "faults.md").read_text() == page()
