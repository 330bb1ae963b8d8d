"""Calibration files in TOML: one model both reads and writes a file."""

import json
from collections.abc import Iterable, Mapping
from typing import Self, cast

from pydantic import BaseModel, ConfigDict, ValidationError

from acquisition.formats import FORMAT, format_problem
from acquisition.settings import SettingsSection, parse_toml
from acquisition.validation import first_problem

_FEW = 3  # largest number of matrix rows written on one line


class TomlTable(SettingsSection):
    """A table of a file; unknown keys are ignored.

    The description of a field is written as a comment above it.
    """

    model_config = ConfigDict(extra="ignore")

    @classmethod
    def parse(cls, text: str) -> Self:
        """Parse and validate a table.

        Raises:
            ValueError: not a valid table; the message names key and problem.
        """
        return cls._of(parse_toml(text))

    @classmethod
    def _of(cls, table: Mapping[str, object]) -> Self:
        try:
            return cls.model_validate(table)
        except ValidationError as error:
            raise ValueError(first_problem(error)) from error


class TomlFile(TomlTable):
    """A complete file with its version."""

    @classmethod
    def parse(cls, text: str) -> Self:
        """Parse and validate a file.

        Raises:
            ValueError: another version or not a valid file; the message names key and
                problem.
        """
        table = parse_toml(text)
        if problem := format_problem(table.get("version")):
            raise ValueError(f"it {problem}")
        return cls._of({key: table[key] for key in table if key != "version"})

    def text(self, comment: str) -> str:
        """Return the text of the file; floats are written exactly.

        Args:
            comment: comment in the first line.
        """
        return f'# {comment}\nversion = "{FORMAT}"\n{_lines(self, "").lstrip()}'


def _lines(table: BaseModel | Mapping[str, object], name: str) -> str:
    """Return the lines of a table's values, then of its subtables."""
    values, tables = "", ""
    for key, (value, comment) in _items(table).items():
        above = f"# {comment}\n" if comment else ""
        if isinstance(value, BaseModel | Mapping):
            inner = cast("BaseModel | Mapping[str, object]", value)
            header = f"{name}{key}"
            tables += f"\n{above}[{header}]\n{_lines(inner, f'{header}.')}"
        elif value is not None:
            values += f"{above}{key} = {_value(value)}\n"
    return values + tables


def _items(
    table: BaseModel | Mapping[str, object],
) -> dict[str, tuple[object, str | None]]:
    """Return values and comments by key, without fields that were not set."""
    if not isinstance(table, BaseModel):
        return {key: (value, None) for key, value in table.items()}
    values = vars(table)
    return {
        key: (values[key], field.description)
        for key, field in type(table).model_fields.items()
        if key in values
    }


def _value(value: object) -> str:
    if isinstance(value, str):
        # JSON escapes the same characters as TOML, except for DEL.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return float.__repr__(value)
    if isinstance(value, list | tuple):
        parts = [_value(part) for part in cast("Iterable[object]", value)]
        if len(parts) > _FEW and parts[0].startswith("["):
            return "[\n" + "".join(f"  {part},\n" for part in parts) + "]"
        return f"[{', '.join(parts)}]"
    return str(value)
