"""What may stand in stored foresight: numbers, increasing numbers, names."""

from typing import Annotated

from pydantic import AfterValidator, Field

_LARGEST, _LONGEST = 1e6, 200

Number = Annotated[float, Field(ge=-_LARGEST, le=_LARGEST, allow_inf_nan=False)]


def increasing(values: tuple[float, ...]) -> tuple[float, ...]:
    """Return the values.

    Raises:
        ValueError: they do not increase.
    """
    if list(values) != sorted(values):
        raise ValueError("the values do not increase")
    return values


def _printable(text: str) -> str:
    if not text.isprintable():
        raise ValueError("it is not printable")
    return text


Range = Annotated[tuple[Number, Number], AfterValidator(increasing)]
Word = Annotated[str, Field(max_length=_LONGEST), AfterValidator(_printable)]
