"""The table that people read is the one that the program is held against."""

from pathlib import Path

from acquisition.control_loop.faults import FAULTS
from tests.faults.__main__ import page
from tests.faults.bounds import read_bounds
from tests.faults.choice import WHY, choice_lines
from tests.faults.phases import MOVING

ROOT = Path(__file__).parents[2]


def test_the_printed_matrix_is_the_tested_one():
    assert (ROOT / "docs" / "faults.md").read_text() == page()


def test_every_fault_says_why_the_arm_is_held_damped_or_idled():
    assert set(WHY) == set(FAULTS)
    rows = choice_lines()[2:]
    assert [row.split("`")[1] for row in rows] == [fault.value for fault in FAULTS]
    idled = read_bounds()["pendant-idle"][MOVING].travel
    assert all(f"| {1e3 * idled:.0f} mm |" in row for row in rows)
