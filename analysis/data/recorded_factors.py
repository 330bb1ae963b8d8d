"""Factors stated by recordings and data packages, restricted to allowed values."""

import json
from collections.abc import Mapping
from typing import Any, NamedTuple, cast

from analysis.data.terrain_kinds import Value

MAX_FACTORS = 13  # the foot among them
MAX_NAME_LENGTH = 60  # characters of names and words
_LARGEST = 1e12
_FEET = {"true": "tread", "false": "bare"}  # as the first recordings state a foot
FOOT = "foot"


class StatedFactors(NamedTuple):
    """Recorded factors of the terrain and the foot.

    Attributes:
        values: factor values by name; None = does not apply.
        units: units of numeric factors by name; "" = none.
    """

    values: dict[str, Value]
    units: dict[str, str]


def foot_of(tread: str) -> str:
    """Return the name of the foot for a recorded `tread`; "" = none."""
    return _FEET.get(tread, tread)


def tread_of(foot: str) -> str:
    """Return the recorded `tread` value of a foot."""
    return {name: tread for tread, name in _FEET.items()}.get(foot, foot)


def value_text(value: Value, digits: int = 6) -> str:
    """Format the value of a factor; "-" = does not apply."""
    if value is None:
        return "-"
    return value if isinstance(value, str) else f"{value:.{digits}g}"


def stated_factors(trial: Mapping[str, str]) -> StatedFactors:
    """Return the factors in a trial's metadata; invalid entries are dropped."""
    foot = trial.get(FOOT) or foot_of(trial.get("tread", ""))
    values = checked_factors(_parsed(trial.get("factors", "")))
    factors = {**values, FOOT: foot[:MAX_NAME_LENGTH]} if foot else values
    texts = _parsed(trial.get("factor_units", ""))
    units = {k: v[:MAX_NAME_LENGTH] for k, v in texts.items() if isinstance(v, str)}
    return StatedFactors(factors, units)


def checked_factors(values: Mapping[str, Any]) -> dict[str, Value]:
    """Keep the values that are valid factors: at most 13, finite, short."""
    kept: dict[str, Value] = {}
    for name, value in list(values.items())[:MAX_FACTORS]:
        if isinstance(value, bool) or not _is_word(name):
            continue
        if value is None or (isinstance(value, str) and _is_word(value)):
            kept[name] = value
        elif isinstance(value, int | float) and abs(value) < _LARGEST:
            kept[name] = float(value)
    return kept


def _is_word(text: str) -> bool:
    return 0 < len(text) <= MAX_NAME_LENGTH and text.isprintable()


def _parsed(text: str) -> dict[str, Any]:
    """Return the object in a JSON text; {} if it holds none."""
    try:
        value: object = json.loads(text) if text else {}
    except (ValueError, RecursionError):
        return {}
    if not isinstance(value, dict):
        return {}
    return {str(k): v for k, v in cast("dict[str, Any]", value).items()}
