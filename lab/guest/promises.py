"""Exit codes that the fault matrix promises for a fault in a phase."""

from collections.abc import Mapping

from lab.guest.commands import require
from tests.faults.expected import TABLE, End
from tests.faults.moving import MOVING_CELLS
from tests.faults.phases import MOVING, PHASES
from tests.faults.processes import TABLE as PROCESSES

# -9 where the console itself was killed. A session that is not activated ends with 3
# when the arm is to become active, with 4 at the prompt.
_CODES: Mapping[End, frozenset[int]] = {
    End.COMPLETE: frozenset({0}),
    End.REFUSED: frozenset({3}),
    End.NOT_ACTIVATED: frozenset({3, 4}),
    End.REDONE: frozenset({0}),
    End.ENDED: frozenset({4}),
    End.KILLED: frozenset({-9}),
    End.UNMEASURED: frozenset({4}),
}


def hold_to(fault: str, phase: str, code: int) -> None:
    """Raise ScenarioError unless the exit code is what the matrix promises.

    Args:
        fault: of the matrix, e.g. "interface-down".
        phase: in which it came, e.g. "recording".
        code: exit code of the program.
    """
    promised = _end(fault, phase)
    require(
        code in _CODES[promised],
        f"{fault} in {phase}: exit code {code}, promised: {promised.value}",
    )


def _end(fault: str, phase: str) -> End:
    if phase == MOVING:
        return MOVING_CELLS[fault].end
    return {**TABLE, **PROCESSES}[fault][PHASES.index(phase)].end
