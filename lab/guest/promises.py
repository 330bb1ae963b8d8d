"""Exit codes that the fault matrix promises for a fault in a phase."""

from collections.abc import Mapping

from lab.guest.commands import require
from tests.faults.expected import TABLE, End
from tests.faults.phases import PHASES

_CODES: Mapping[End, int] = {End.COMPLETE: 0, End.ENDED: 4}


def require_promised(fault: str, phase: str, code: int) -> None:
    """Raise ScenarioError unless the exit code is the one promised by the matrix.

    Args:
        fault: fault of the matrix, e.g. "interface-down".
        phase: phase of the fault, e.g. "recording".
        code: exit code of the program.
    """
    promised = TABLE[fault][PHASES.index(phase)].end
    require(
        code == _CODES[promised],
        f"{fault} in {phase}: exit code {code}, promised: {promised.value}",
    )
