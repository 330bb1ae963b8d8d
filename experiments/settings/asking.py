"""A few questions at a terminal whose answers make a matrix."""

import re
from collections.abc import Callable, Sequence
from typing import TypeVar

from experiments.settings.writing import AskedDesign, AskedFactor

_T = TypeVar("_T")
_FACTOR = re.compile(
    r"(?P<name>[a-z][a-z0-9_]{0,23})\s*(?:\[(?P<unit>[^\]]{1,16})\])?\s*:\s*(?P<levels>.+)"
)
_WORD = re.compile(r"[A-Za-z0-9][A-Za-z0-9 ._+/-]{0,39}")
_FOOT = re.compile(r"[a-z][a-z0-9_]{0,15}")

QUESTIONS = (
    "Grain sizes of your gravels in mm, e.g. 12 19 37 (empty = a plate): ",
    "What else varies? e.g. moisture: dry, wet   or   load [kg]: 1, 2 (empty = done): ",
    "Inclines of the container in degrees, positive where its far end is high, e.g. "
    "-10 0 10 (empty = 0): ",
    "Names of your feet, e.g. tread bare round (empty = tread): ",
    "Trials of every cell (empty = 10): ",
)


def ask_design(ask: Callable[[str], str], tell: Callable[[str], None]) -> AskedDesign:
    """Return what a person answers; a wrong answer is asked for again.

    Args:
        ask: shows a question and returns the answer.
        tell: shows what is wrong with an answer.
    """

    def until_right(question: str, read: Callable[[str], _T]) -> _T:
        while True:
            try:
                return read(ask(question).strip())
            except ValueError as error:
                tell(f"{error}. Again, please.")

    sizes = until_right(QUESTIONS[0], lambda text: _numbers(text, 0.01, 500.0))
    factors: list[AskedFactor] = []
    while True:
        factor = until_right(QUESTIONS[1], _factor)
        if factor is None:
            break
        factors.append(factor)
    inclines = until_right(QUESTIONS[2], lambda text: _numbers(text or "0", -30, 30))
    feet = until_right(QUESTIONS[3], _feet)
    trials = until_right(QUESTIONS[4], _trials)
    return AskedDesign(sizes, tuple(factors), inclines, feet, trials)


def _parts(text: str) -> list[str]:
    return [part.strip() for part in re.split(r"[,;]|\s+", text) if part.strip()]


def _numbers(text: str, low: float, high: float) -> tuple[float, ...]:
    """Return different numbers between two bounds.

    Raises:
        ValueError: one is none, out of bounds, or there twice.
    """
    values: list[float] = []
    for part in _parts(text):
        try:
            value = float(part)
        except ValueError:
            raise ValueError(f"{part!r} is no number") from None
        if not low <= value <= high:
            raise ValueError(f"{value:g} is not between {low:g} and {high:g}")
        values.append(value)
    _check_once(values)
    return tuple(values)


def _check_once(values: Sequence[object]) -> None:
    if len(set(values)) < len(values):
        raise ValueError("one is there twice")


def _factor(text: str) -> AskedFactor | None:
    if not text:
        return None
    found = _FACTOR.fullmatch(text)
    if found is None:
        raise ValueError("it is not of the form  name: level, level")
    levels = [part.strip() for part in found["levels"].split(",") if part.strip()]
    _check_once(levels)
    if len(levels) < 2:
        raise ValueError("what varies has at least two levels")
    try:
        numbers = tuple(float(level) for level in levels)
    except ValueError:
        if strange := [level for level in levels if not _WORD.fullmatch(level)]:
            raise ValueError(f"{strange[0]!r} is no word for a level") from None
        return AskedFactor(found["name"], "", tuple(levels))
    return AskedFactor(found["name"], found["unit"] or "", numbers)


def _feet(text: str) -> tuple[str, ...]:
    names = _parts(text) or ["tread"]
    _check_once(names)
    if strange := [name for name in names if not _FOOT.fullmatch(name)]:
        raise ValueError(f"{strange[0]!r} is no name: small letters and digits")
    return tuple(names)


def _trials(text: str) -> int:
    if not text:
        return 10
    if not text.isdecimal() or not 1 <= int(text) <= 99:
        raise ValueError("a whole number from 1 to 99 is needed")
    return int(text)
