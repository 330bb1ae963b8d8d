"""Exit codes are compared with those that the fault matrix states."""

import pytest

from lab.guest.commands import ScenarioError
from lab.guest.promises import require_promised


@pytest.mark.parametrize(
    ("fault", "phase", "code"),
    [("interface-down", "recording", 4), ("interface-down", "end", 0)],
)
def test_an_exit_code_is_compared_with_its_cell(fault, phase, code):
    require_promised(fault, phase, code)
    with pytest.raises(ScenarioError, match="exit code 99, promised"):
        require_promised(fault, phase, 99)


def test_a_fault_that_is_not_in_the_matrix_is_an_error():
    with pytest.raises(KeyError, match="unheard-of"):
        require_promised("unheard-of", "recording", 0)
