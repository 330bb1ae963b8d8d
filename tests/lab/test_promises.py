"""What docs/faults.md promises, as the laboratory reads it."""

import pytest

from lab.guest.commands import ScenarioError
from lab.guest.promises import PAGE, hold_to, promise, promised
from lab.guest.scenarios.losses import PHASES

TEXT = """\
| fault | idle | recording |
|---|---|---|
| `estop` | not activated, resumed [3] | session ends, resumed |

| fault | speed, recording |
|---|---|
| `estop` | 0.36 (J4) [b] |
"""


def test_a_cell_is_read_without_its_note():
    assert promised(TEXT, "estop", "idle") == "not activated, resumed"


def test_a_table_without_the_phase_is_passed_over():
    assert promised(TEXT, "estop", "recording") == "session ends, resumed"


@pytest.mark.parametrize(("fault", "phase"), [("bus-off", "idle"), ("estop", "end")])
def test_a_cell_that_is_not_there_is_no_promise(fault, phase):
    with pytest.raises(ScenarioError):
        promised(TEXT, fault, phase)


@pytest.mark.parametrize("phase", [*PHASES, "end", "moving"])
def test_the_page_has_every_phase_in_which_the_link_goes_down(phase):
    assert promise("interface-down", phase)


def test_an_exit_code_is_held_to_its_cell():
    hold_to("session ends, resumed", 4)
    with pytest.raises(ScenarioError, match="exit code 0"):
        hold_to("session ends, resumed", 0)


def test_a_cell_without_a_known_exit_code_is_refused():
    with pytest.raises(ScenarioError, match="unheard of"):
        hold_to("unheard of", 0)


def test_the_page_is_the_projects():
    assert PAGE.parts[-2:] == ("docs", "faults.md")
