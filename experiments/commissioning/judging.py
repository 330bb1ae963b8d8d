"""Judgement of a step: quantities against their limits.

The limits are in limits.toml, by step. Each record contains the limits it was judged
by, so that they can be revised from data.
"""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources

from experiments.commissioning.evidence.record import Measured


@dataclass(frozen=True, slots=True)
class Limit:
    """Limits of a quantity.

    Attributes:
        name: name of the quantity; may contain `{joint}`.
        unit: unit of all values; "" = a count.
        wrong: diagnosis of a value beyond the limits; may contain `{joint}`.
        source: source of the limits.
        low: lower limit; None = no such limit, or computed by the judge.
        high: upper limit; None as for `low`.
    """

    name: str
    unit: str
    wrong: str
    source: str
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True, slots=True)
class JudgedQuantity:
    """A quantity with its limits and its diagnosis.

    Attributes:
        measured: the quantity with its limits.
        wrong: diagnosis if it is beyond the limits.
    """

    measured: Measured
    wrong: str


@dataclass(frozen=True, slots=True)
class Judgement:
    """Judgement of a step.

    Attributes:
        quantities: the quantities in order of judgement.
        cause: the first contradiction; "" = none.
        notes: warnings that do not fail the step.
    """

    quantities: tuple[Measured, ...]
    cause: str
    notes: tuple[str, ...] = ()


def _read_limits() -> dict[str, Limit]:
    """Read the limits by their names in limits.toml, which are unique."""
    path = resources.files("experiments.commissioning") / "limits.toml"
    text = path.read_text("utf-8")
    steps: dict[str, dict[str, dict[str, str | float]]] = tomllib.loads(text)
    rows = [row for step in steps.values() for row in step.items()]
    limits = {name: Limit(**fields) for name, fields in rows}  # pyright: ignore[reportArgumentType]
    if len(limits) != len(rows):
        raise ValueError("limits.toml has a name twice")
    return limits


LIMITS: Mapping[str, Limit] = _read_limits()


def judge_quantity(
    key: str,
    value: float,
    *,
    low: float | None = None,
    high: float | None = None,
    **fields: object,
) -> JudgedQuantity:
    """Return a quantity with its limits.

    Args:
        key: key of `LIMITS`.
        value: measured value.
        low: replaces the lower limit, e.g. if it differs by joint.
        high: replaces the upper limit.
        fields: fields of its texts.
    """
    limit = LIMITS[key]
    measured = Measured(
        name=limit.name.format(**fields),
        value=float(value),
        unit=limit.unit,
        low=limit.low if low is None else low,
        high=limit.high if high is None else high,
    )
    return JudgedQuantity(
        measured, limit.wrong.format(**fields) if fields else limit.wrong
    )


def judged(rows: Sequence[JudgedQuantity], notes: Sequence[str] = ()) -> Judgement:
    """Return the judgement of a step; its cause is the first quantity that fails."""
    first = next((row for row in rows if not row.measured.is_within), None)
    cause = "" if first is None else f"{first.measured.text}. {first.wrong}"
    quantities = tuple(row.measured for row in rows)
    return Judgement(quantities, cause[:400], tuple(notes))
