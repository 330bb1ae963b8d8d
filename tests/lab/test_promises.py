"""What the fault matrix promises, as the laboratory reads it."""

import pytest

from lab.guest.commands import ScenarioError
from lab.guest.promises import hold_to


@pytest.mark.parametrize(
    ("fault", "phase", "code"),
    [("interface-down", "recording", 4), ("interface-down", "end", 0)],
)
def test_an_exit_code_is_held_to_its_cell(fault, phase, code):
    hold_to(fault, phase, code)
    with pytest.raises(ScenarioError, match="exit code 99, promised"):
        hold_to(fault, phase, 99)


def test_a_fault_that_is_not_in_the_matrix_has_no_promise():
    with pytest.raises(KeyError, match="unheard-of"):
        hold_to("unheard-of", "recording", 0)
