"""What docs/faults.md promises for a fault in a phase, as exit codes."""

from pathlib import Path

from lab.guest.commands import ScenarioError, require

PAGE = Path(__file__).parents[2] / "docs" / "faults.md"
# Exit codes by how a cell ends; -9 where the console itself was killed. A session that
# is not activated ends with 3 when the arm is to become active, with 4 at the prompt.
_CODES = {
    "nothing happens": {0},
    "refused, nothing created": {3},
    "not activated, resumed": {3, 4},
    "trial interrupted and redone": {0},
    "session ends, resumed": {4},
    "ends; the arm is idle without it, resumed": {-9},
    "the arm stops, nothing is written": {4},
}


def promise(fault: str, phase: str) -> str:
    """Return the cell of a fault and a phase, without its note.

    Raises:
        ScenarioError: the page has no such cell.
    """
    return promised(PAGE.read_text(encoding="utf-8"), fault, phase)


def promised(page: str, fault: str, phase: str) -> str:
    """Return the same of a text; the first table that has the phase counts."""
    phases: list[str] = []
    for line in page.splitlines():
        cells = [cell.strip() for cell in line.strip("| ").split("|")]
        if cells[0] == "fault":
            phases = cells
        elif cells[0] == f"`{fault}`" and phase in phases:
            return cells[phases.index(phase)].partition(" [")[0]
    raise ScenarioError(f"docs/faults.md has no {fault} in {phase}")


def hold_to(promise: str, code: int) -> None:
    """Raise ScenarioError unless an exit code is what a cell of the page means."""
    if promise not in _CODES:
        raise ScenarioError(f"no exit code is known for {promise!r}")
    require(code in _CODES[promise], f"exit code {code}, promised: {promise}")
