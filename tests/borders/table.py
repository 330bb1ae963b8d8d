"""The table of borders: what is given, and what happens."""

from tests.borders.calls import CALLS
from tests.borders.formats import FORMATS
from tests.borders.layouts import LAYOUTS
from tests.borders.numbers import NUMBERS
from tests.borders.row import Border
from tests.borders.simulated import SIMULATED

# A subject of its own is a module with its rows, named here.
SUBJECTS: dict[str, tuple[Border, ...]] = {
    "Text tables: layout": LAYOUTS,
    "Text tables: numbers, units and times": NUMBERS,
    "Other formats": FORMATS,
    "Simulated and recorded": SIMULATED,
    "Calls and names of files": CALLS,
}
HEAD = """\
# Borders

What other programs and people give to this one, and what happens: it is read exactly,
read exactly and flagged by name, or refused with its cause.
"""


def text() -> str:
    """Return the table in Markdown."""
    count = sum(len(rows) for rows in SUBJECTS.values())
    lines = [HEAD, f"{count} rows.", ""]
    for subject, rows in SUBJECTS.items():
        lines += [
            f"## {subject}",
            "",
            "| given | what happens | words of the answer |",
            "| --- | --- | --- |",
            *(
                f"| {_cell(row.given)} | {row.outcome.value} | {_cell(row.says)} |"
                for row in rows
            ),
            "",
        ]
    return "\n".join(lines)


def _cell(words: str) -> str:
    return words.replace("|", "\\|").replace("<", "&lt;").replace("*", "\\*")
