"""The table of disturbances, measured when it is printed."""

from tests.disturbances.measure import Seen, recorded_trial, see_recording, see_table
from tests.disturbances.rows import RECORDINGS, TABLES, Outcome

HEAD = """\
# Disturbances

What can be wrong with a trial although no fault is raised, and the result.
Nothing passes silently: it is refused, flagged with its likely cause, or harmless,
and then a number says how harmless.
"""
_LONGEST = 160  # characters of what was said


def text() -> str:
    """Return the table in Markdown."""
    tables = [(row.name, see_table(row)) for row in TABLES]
    with recorded_trial() as path:
        recordings = [(row.name, see_recording(row, path)) for row in RECORDINGS]
    return "\n".join(
        [
            HEAD,
            *_table("Tables, as `traction fit` reads them", tables),
            "",
            *_table("Recorded trials, as the review shows them", recordings),
            "",
        ]
    )


def _table(title: str, rows: list[tuple[str, Seen]]) -> list[str]:
    return [
        f"## {title}",
        "",
        "| disturbance | result | message, or change of F_t/F_n |",
        "| --- | --- | --- |",
        *(f"| {name} | {seen.outcome.value} | {_said(seen)} |" for name, seen in rows),
    ]


def _said(seen: Seen) -> str:
    if seen.outcome is Outcome.HARMLESS:
        return f"{seen.changed:.1%}"
    words = seen.words.replace("|", "/")
    return words if len(words) <= _LONGEST else words[: _LONGEST - 3] + "..."
