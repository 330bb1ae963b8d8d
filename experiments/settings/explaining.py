"""Explain the errors of a settings file, with lines and probable intentions."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, cast, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from experiments.arguments import nearest
from experiments.settings.numbers import number_at, number_words

_MOST = 8  # errors in one message
_HEADER = re.compile(r"^\s*(\[\[|\[)\s*([\w.\" -]+?)\s*\]")
_KEY = re.compile(r"""^\s*["']?([\w-]+)["']?\s*[=.]""")


def line_of(text: str, name: str) -> int | None:
    """Return the line number of a setting in a TOML text.

    The line of its key, or of the table that should have it; None if neither is at the
    beginning of a line.

    Args:
        text: the TOML.
        name: dotted name, e.g. "terrains[3].trials".
    """
    lines: dict[str, int] = {}
    counts: dict[str, int] = {}
    table = ""
    for number, line in enumerate(text.splitlines(), 1):
        if header := _HEADER.match(line):
            table = header[2].replace('"', "").replace(" ", "")
            if header[1] == "[[":
                counts[table] = counts.get(table, -1) + 1
                table = f"{table}[{counts[table]}]"
            lines.setdefault(table, number)
        elif key := _KEY.match(line):
            lines.setdefault(f"{table}.{key[1]}".lstrip("."), number)
    while name and name not in lines:
        name = name[: max(name.rfind("."), name.rfind("["), 0)]
    return lines.get(name)


def explain(
    model: type[BaseModel],
    name: str,
    text: str,
    error: ValidationError,
    inside: str = "",
) -> str:
    """Describe the errors of a file that should be a `model`.

    All errors are reported, each with its line. A misspelt key is one error, not an
    unknown key and a missing one.

    Args:
        model: model of the file.
        name: name of the file.
        text: its content.
        error: error of pydantic.
        inside: table that should be the model, e.g. "cells[3]"; empty = the whole file.
    """
    errors = sorted(error.errors(), key=lambda e: e["type"] == "missing")
    parts: list[str] = []
    meant: set[tuple[int | str, ...]] = set()
    for detail in errors:
        where = detail["loc"]
        if detail["type"] == "extra_forbidden":
            missing = {
                str(e["loc"][-1]): e["loc"]
                for e in errors
                if e["type"] == "missing" and e["loc"][:-1] == where[:-1]
            }
            key = nearest(str(where[-1]), missing)
            if key is not None:
                meant.add(missing[key])
        if where not in meant:
            parts.append(_sentence(model, text, detail, inside))
    more = [f"and {len(parts) - _MOST} more"] if parts[_MOST:] else []
    return f"{name}: {'; '.join([*parts[:_MOST], *more])}."


def _sentence(
    model: type[BaseModel], text: str, error: ErrorDetails, inside: str
) -> str:
    """Describe one error, without full stop, with its line at the end."""
    location = _locate(model, error["loc"], inside)
    line = line_of(text, location.name)
    return _reason(location, error) + (f" (line {line})" if line else "")


def _reason(location: "_Location", error: ErrorDetails) -> str:
    name = location.name
    if error["type"] == "missing":
        return f"{name} is missing{location.example}"
    if error["type"] == "extra_forbidden":
        option = str(error["loc"][-1])
        meant = nearest(option, location.siblings)
        asked = "" if meant is None else f" - did you mean {meant}?"
        return f"{name} {_refusal(location, option)}{asked}"
    if error["type"] == "union_tag_not_found":
        return f"{name}.kind is missing, e.g. {_kinds(location.kinds)}"
    if error["type"] == "union_tag_invalid":
        got = error.get("ctx", {}).get("tag")
        return f'{name}.kind = "{got}" - expected {_kinds(location.kinds)}'
    is_table = isinstance(error["input"], Mapping)
    got = cast("object", error["input"])
    shown = f'"{got:.80}"' if isinstance(got, str) else f"{got!r:.80}"
    what = error["msg"].removeprefix("Value error, ")
    if is_table and error["type"] == "value_error":
        return f"{name}: {what}" if name else what
    number = number_at(location.field, location.item)
    if number is None:
        expected = what.removeprefix("Input should be ")
        return f"{name} = {shown} - expected {expected}{location.example}"
    expected, meant = number_words(number, got)
    return f"{name} = {shown} - expected {expected}{location.example}{meant}"


@dataclass(frozen=True, slots=True)
class _Location:
    """A setting in a settings file.

    Attributes:
        name: dotted name.
        field: the field; None if unknown.
        kinds: sections that a `kind` above it selects from; or none.
        kind: the selected kind.
        siblings: permitted keys of its table.
        item: index in the field's list; None = no list.
    """

    name: str
    field: FieldInfo | None
    kinds: Mapping[str, type[BaseModel]]
    kind: str
    siblings: Sequence[str]
    item: int | None = None

    @property
    def example(self) -> str:
        """An example of the field to end a sentence; or nothing."""
        examples = self.field.examples if self.field else None
        return f", e.g. {examples[0]}" if examples else ""


def _locate(
    model: type[BaseModel], location: tuple[int | str, ...], inside: str
) -> _Location:
    """Resolve the `location` of an error, in which a kind appears like a table."""
    current: type[BaseModel] | None = model
    field: FieldInfo | None = None
    kinds: Mapping[str, type[BaseModel]] = {}
    name, kind = inside, ""
    siblings: Sequence[str] = ()
    item: int | None = None
    is_named = False  # next part is the name of one of several tables
    for part in location:
        if is_named and isinstance(part, str):
            name, is_named = f"{name}.{part}", False
            continue
        siblings = tuple(current.model_fields) if current else siblings
        if isinstance(part, int):
            name += f"[{part}]"
            item = part
        elif current is None and part in kinds and not kind:
            kind, current = part, kinds[part]
        else:
            name += f".{part}"
            item = None
            field = current.model_fields.get(part) if current else None
            sections = _sections_of(field.annotation) if field else []
            is_named = field is not None and get_origin(field.annotation) is dict
            current = sections[0] if len(sections) == 1 else None
            if len(sections) > 1:
                kinds = {_kind_of(section): section for section in sections}
    return _Location(name.lstrip("."), field, kinds, kind, siblings, item)


def _sections_of(annotation: Any) -> list[type[BaseModel]]:  # noqa: ANN401
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [
        section for inner in get_args(annotation) for section in _sections_of(inner)
    ]


def _kind_of(section: type[BaseModel]) -> str:
    return str(get_args(section.model_fields["kind"].annotation)[0])


def _kinds(kinds: Mapping[str, type[BaseModel]]) -> str:
    *others, last = (f"'{kind}'" for kind in kinds)
    return f"{', '.join(others)} or {last}"


def _refusal(location: _Location, option: str) -> str:
    """Explain an unknown `option`; names the kinds that have it."""
    others = [kind for kind, s in location.kinds.items() if option in s.model_fields]
    if not others:
        return "is not a setting Traction knows"
    names = " and ".join(f'"{kind}"' for kind in others)
    return f'belongs to kind {names}, this is a "{location.kind}"'
