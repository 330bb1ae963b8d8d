"""Why a table is not read: file, line, column, what stands there, what was expected."""

from pathlib import Path

from acquisition.errors import SettingsError

_LONGEST = 40  # characters of a cell that are shown


def refusal(path: Path, reason: str, hint: str) -> SettingsError:
    """Return why a file is not read."""
    return SettingsError(f"{path}: {reason}.", hint=hint)


def refused_line(path: Path, line: int, reason: str, hint: str) -> SettingsError:
    """Return why a line of a file is not read; the first one is 1."""
    return SettingsError(f"{path}, line {line}: {reason}.", hint=hint)


def refused_cell(
    path: Path, line: int, column: str, cell: str, expected: str, hint: str
) -> SettingsError:
    """Return why a cell is not read."""
    shown = cell if len(cell) <= _LONGEST else cell[:_LONGEST] + "..."
    return SettingsError(
        f"{path}, line {line}, column {column}: {shown!r} stands where {expected} was "
        "expected.",
        hint=hint,
    )
