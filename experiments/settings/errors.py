"""What is wrong with a settings file, in one sentence with an example."""

from typing import Any, get_args

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

_KINDS: dict[object, str] = {int: "a whole number", float: "a number"}
_BOUNDS = (("gt", ">"), ("ge", ">="), ("lt", "<"), ("le", "<="))


def explain(model: type[BaseModel], name: str, error: ValidationError) -> str:
    """Return what is wrong with file `name`, which should have been a `model`.

    Of several errors the first is told.
    """
    first = error.errors()[0]
    place = ""
    for part in first["loc"]:
        place += f"[{part}]" if isinstance(part, int) else f".{part}"
    place = place.lstrip(".")
    if first["type"] == "missing":
        return f"{name}: {place} is missing{_example(model, first['loc'])}."
    if first["type"] == "extra_forbidden":
        return f"{name}: {place} is no setting Traction knows."
    got = first["input"]
    shown = f'"{got}"' if isinstance(got, str) else repr(got)
    expected = _expected(model, first["loc"], first["msg"])
    return (
        f"{name}: {place} = {shown} - expected {expected}"
        f"{_example(model, first['loc'])}."
    )


def _expected(
    model: type[BaseModel], location: tuple[int | str, ...], otherwise: str
) -> str:
    """Return what a number should be, with its bounds; else what pydantic says."""
    field = _field_at(model, location)
    kind = _KINDS.get(field.annotation) if field else None
    if field is None or kind is None:
        return otherwise.removeprefix("Input should be ")
    bounds = [
        f"{sign} {getattr(constraint, name)}"
        for constraint in field.metadata
        for name, sign in _BOUNDS
        if hasattr(constraint, name)
    ]
    return f"{kind} {' and '.join(bounds)}".rstrip()


def _example(model: type[BaseModel], location: tuple[int | str, ...]) -> str:
    """Return ", e.g. ..." from the examples of the field at `location`."""
    field = _field_at(model, location)
    return f", e.g. {field.examples[0]}" if field and field.examples else ""


def _field_at(
    model: type[BaseModel], location: tuple[int | str, ...]
) -> FieldInfo | None:
    """Return the last field on the way along `location`."""
    current: type[BaseModel] | None = model
    found: FieldInfo | None = None
    for part in location:
        if not isinstance(part, str) or current is None:
            continue
        found = current.model_fields.get(part)
        current = _section_of(found.annotation) if found else None
    return found


def _section_of(annotation: Any) -> type[BaseModel] | None:  # noqa: ANN401
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    for inner in get_args(annotation):
        found = _section_of(inner)
        if found is not None:
            return found
    return None
