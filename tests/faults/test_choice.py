"""Tables and page state the reaction to every fault of the guard and its reason."""

from pathlib import Path

from acquisition.control_loop.faults import FAULTS
from tests.faults.bounds import read_bounds
from tests.faults.choice import WHY, choice_lines
from tests.faults.phases import MOVING
from tests.faults.printed import text

ROOT = Path(__file__).parents[2]


def test_the_printed_tables_have_every_fault():
    printed = text()
    faults = [*read_bounds(), *(fault.value for fault in FAULTS)]
    assert all(f"| `{fault}` |" in printed for fault in faults)


def test_the_hazard_page_states_the_effect_of_each_fault():
    page = (ROOT / "docs" / "hazards.md").read_text()
    _, _, reactions = page.partition("| reaction |")
    assert all(f"`{fault.value}`" in reactions for fault in FAULTS)


def test_every_fault_states_the_reason_for_its_action():
    assert set(WHY) == set(FAULTS)
    rows = choice_lines()[2:]
    assert [row.split("`")[1] for row in rows] == [fault.value for fault in FAULTS]
    idled = read_bounds()["pendant-idle"][MOVING].travel
    assert all(f"| {1e3 * idled:.0f} mm |" in row for row in rows)
