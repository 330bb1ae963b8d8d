"""Print the fault matrix as a table in Markdown: `python -m tests.faults`."""

from tests.faults.expected import TABLE, Cell, End
from tests.faults.phases import PHASES
from tests.faults.processes import TABLE as PROCESSES

HEAD = """\
# Every fault in every phase

What comes of each fault that `--fault` can raise, and of signals and killed processes,
in each phase of a session. Made by `python -m tests.faults > docs/faults.md`; the tests
in `tests/faults` hold the program against it.
"""


def lines() -> list[str]:
    """Return the table, and below it why some cells are as they are."""
    notes: list[str] = []

    def word(cell: Cell) -> str:
        if not cell.why:
            return cell.end.value
        if cell.why not in notes:
            notes.append(cell.why)
        return f"{cell.end.value} [{notes.index(cell.why) + 1}]"

    rows = [f"| fault | {' | '.join(PHASES)} |", "|---" * (len(PHASES) + 1) + "|"]
    for fault, row in {**TABLE, **PROCESSES}.items():
        rows.append(f"| `{fault}` | {' | '.join(word(cell) for cell in row)} |")
    rows += ["", *(f"[{n}] {why}." for n, why in enumerate(notes, 1))]
    cells = [c for row in {**TABLE, **PROCESSES}.values() for c in row]
    absent = sum(cell.end is End.ABSENT for cell in cells)
    return [*rows, "", f"{len(cells) - absent} cells, {absent} cannot exist."]


def page() -> str:
    """Return docs/faults.md."""
    return "\n".join([HEAD, *lines()]) + "\n"


if __name__ == "__main__":
    print(page(), end="")  # noqa: T201
