"""Errors for tables that cannot be read, with file, line, column and expectation."""

from pathlib import Path

from acquisition.errors import SettingsError

_LONGEST = 40  # characters of a cell shown in a message


def refusal(path: Path, reason: str, hint: str) -> SettingsError:
    """Make the error for a file."""
    return SettingsError(f"{path}: {reason}.", hint=hint)


def refused_line(path: Path, line: int, reason: str, hint: str) -> SettingsError:
    """Make the error for a line of a file, from 1."""
    return SettingsError(f"{path}, line {line}: {reason}.", hint=hint)


def refused_cell(
    path: Path, line: int, column: str, cell: str, expected: str, hint: str
) -> SettingsError:
    """Make the error for a cell."""
    shown = cell if len(cell) <= _LONGEST else cell[:_LONGEST] + "..."
    return SettingsError(
        f"{path}, line {line}, column {column}: {shown!r} stands where {expected} was "
        "expected.",
        hint=hint,
    )
