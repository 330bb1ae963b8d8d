"""What the fault matrix promises, as the laboratory reads it."""

import pytest

from lab.guest.commands import ScenarioError
from lab.guest.promises import hold_to
from lab.guest.scenarios.losses import PHASES


@pytest.mark.parametrize("phase", [*PHASES, "end", "moving"])
def test_every_phase_in_which_the_link_goes_down_has_an_exit_code(phase):
    with pytest.raises(ScenarioError, match="exit code 99, promised"):
        hold_to("interface-down", phase, 99)


@pytest.mark.parametrize(
    ("fault", "phase", "code"),
    [
        ("interface-down", "recording", 4),
        ("interface-down", "end", 0),
        ("console killed", "recording", -9),
        ("reply-lost-some", "recording", 0),
    ],
)
def test_an_exit_code_is_held_to_its_cell(fault, phase, code):
    hold_to(fault, phase, code)


def test_a_fault_that_is_not_in_the_matrix_has_no_promise():
    with pytest.raises(KeyError, match="unheard-of"):
        hold_to("unheard-of", "idle", 0)
