"""Numbers of settings: bounds as text, probable intentions, unusual values.

Bounds, unit and usual values are declared with each number in its section: a number
out of bounds is refused, an unusual one causes a warning.
"""

from collections.abc import Iterator
from typing import Any, cast, get_args

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from acquisition.settings import UsualRange

_NUMBERS: dict[object, str] = {int: "a whole number", float: "a number"}
_BOUNDS = (("gt", ">"), ("ge", ">="), ("lt", "<"), ("le", "<="))
_DEGREE = 0.017453292519943295  # rad
# By unit: units that numbers are typed in by mistake, with their factors.
_OTHERS: dict[str, tuple[tuple[str, float], ...]] = {
    "rad": (("degrees", _DEGREE),),
    "rad/s": (("degrees/s", _DEGREE),),
    "degrees": (("rad", 1.0 / _DEGREE),),
    "m": (("cm", 0.01), ("mm", 0.001)),
    "m/s": (("cm/s", 0.01), ("mm/s", 0.001)),
    "kg": (("g", 0.001),),
    "kg m^2": (("kg cm^2", 1e-4), ("kg mm^2", 1e-6), ("g cm^2", 1e-7)),
    "N m": (("N cm", 0.01), ("N mm", 0.001)),
    "ms": (("us", 0.001), ("s", 1000.0)),
    "us": (("ns", 0.001), ("ms", 1000.0)),
    "mrad": (("rad", 1000.0), ("degrees", 1000.0 * _DEGREE)),
    "s": (("ms", 0.001),),
}
_DECIMAL_POINT = (0.1, 0.01, 0.001, 10.0, 100.0)


def number_at(field: FieldInfo | None, item: int | None) -> FieldInfo | None:
    """Return the number of a `field`, or of an `item` of it, or None."""
    while field is not None and field.annotation not in _NUMBERS:
        kinds = [kind for kind in get_args(field.annotation) if kind is not type(None)]
        if item is not None and len(kinds) > 1:
            kinds, item = kinds[item : item + 1], None
        # An optional number is a union with None; a list of any length has one kind.
        field = FieldInfo.from_annotation(kinds[0]) if len(kinds) == 1 else None
    return field


def number_words(number: FieldInfo, got: object) -> tuple[str, str]:
    """Return the expected number as text, with bounds and unit; the likely mistake."""
    usual = _usual(number)
    unit = usual.unit if usual else ""
    bounds = [
        f"{sign} {getattr(constraint, name)}"
        for constraint in number.metadata
        for name, sign in _BOUNDS
        if hasattr(constraint, name)
    ]
    words = f"{_NUMBERS[number.annotation]} {' and '.join(bounds)} {unit}".strip()
    return words, _meant(number, got)


def _usual(number: FieldInfo) -> UsualRange | None:
    return next(
        (entry for entry in number.metadata if isinstance(entry, UsualRange)), None
    )


def _meant(number: FieldInfo, got: object) -> str:
    """Return the likely mistake behind a number as a question; "" = none."""
    if not isinstance(got, int | float) or isinstance(got, bool):
        return ""
    usual, value = _usual(number), float(got)
    if usual is None:
        return ""

    def is_usual(factor: float) -> bool:
        return value != 0.0 and usual.low <= factor * value <= usual.high

    for unit, factor in _OTHERS.get(usual.unit, ()):
        if is_usual(factor):
            return f" - is it in {unit}?"
    if is_usual(-1.0):
        return " - is its sign right?"
    if any(is_usual(factor) for factor in _DECIMAL_POINT):
        return " - is its decimal point right?"
    return ""


def unusual_numbers(section: BaseModel) -> Iterator[str]:
    """Yield a sentence for each unusual number."""
    for place, number, usual, value in _usual_numbers(section, ""):
        if not usual.low <= value <= usual.high:
            band = f"{usual.low:g} to {usual.high:g} {usual.unit}".rstrip()
            yield f"{place} = {value:g}, usual is {band}{_meant(number, value)}"


def beyond_real(section: BaseModel) -> str:
    """Describe the first number that a real arm may not have, else ""."""
    for place, _, usual, value in _usual_numbers(section, ""):
        if usual.real is not None and value > usual.real:
            return f"{place} = {value:g} - expected <= {usual.real:g} {usual.unit}"
    return ""


def _usual_numbers(
    section: BaseModel, place: str
) -> Iterator[tuple[str, FieldInfo, UsualRange, float]]:
    """Yield (dotted name, field, usual values, value) of every number that has them."""
    for name, field in type(section).model_fields.items():
        here = f"{place}.{name}".lstrip(".")
        value: Any = getattr(section, name)
        if isinstance(value, dict):  # sections by name
            for key, inner in cast("dict[str, Any]", value).items():
                if isinstance(inner, BaseModel):
                    yield from _usual_numbers(inner, f"{here}.{key}")
            continue
        items = cast("tuple[Any, ...]", value) if isinstance(value, tuple) else (value,)
        for index, entry in enumerate(items):
            item = index if isinstance(value, tuple) else None
            there = here if item is None else f"{here}[{item}]"
            if isinstance(entry, BaseModel):
                yield from _usual_numbers(entry, there)
            elif entry is not None and (number := number_at(field, item)) is not None:
                usual = _usual(number)
                if usual is not None:
                    yield there, number, usual, entry
