"""Calibrations in TOML: one model of a file reads it and writes it."""

import json
from collections.abc import Iterable, Mapping
from typing import Self, cast

from pydantic import BaseModel, ConfigDict, ValidationError

from acquisition.formats import FORMAT, format_problem
from acquisition.settings import SettingsSection, parse_toml
from acquisition.validation import first_problem

_FEW = 3  # rows of a matrix that stay in one line


class TomlTable(SettingsSection):
    """A table of such a file: keys that it does not know are left alone.

    The description of a field is the comment above it.
    """

    model_config = ConfigDict(extra="ignore")

    @classmethod
    def parse(cls, text: str) -> Self:
        """Return what `text` holds.

        Raises:
            ValueError: it is no such table; the message names the key and what is
                wrong.
        """
        return cls._of(parse_toml(text))

    @classmethod
    def _of(cls, table: Mapping[str, object]) -> Self:
        try:
            return cls.model_validate(table)
        except ValidationError as error:
            raise ValueError(first_problem(error)) from error


class TomlFile(TomlTable):
    """A whole file, which states its version."""

    @classmethod
    def parse(cls, text: str) -> Self:
        """Return what `text` holds.

        Raises:
            ValueError: it is of another version, or no such file; the message names the
                key and what is wrong.
        """
        table = parse_toml(text)
        if problem := format_problem(table.get("version")):
            raise ValueError(f"it {problem}")
        return cls._of({key: table[key] for key in table if key != "version"})

    def text(self, comment: str) -> str:
        """Return the text of the file; floats keep every bit.

        Args:
            comment: its first line.
        """
        return f'# {comment}\nversion = "{FORMAT}"\n{_lines(self, "").lstrip()}'


def _lines(table: BaseModel | Mapping[str, object], name: str) -> str:
    """Return the values of a table, then the tables in it."""
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
    """Return values and comments by key; what was never given is left out."""
    if not isinstance(table, BaseModel):
        return {key: (value, None) for key, value in table.items()}
    known = vars(table)
    return {
        key: (known[key], field.description)
        for key, field in type(table).model_fields.items()
        if key in known
    }


def _value(value: object) -> str:
    if isinstance(value, str):
        # JSON escapes what TOML does, but for one character.
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
