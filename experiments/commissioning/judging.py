"""The judge of a commissioning: quantities against their limits.

The limits stand in limits.toml beside this module, by step. Each record keeps those it
was judged by, so that they can be revised from data.
"""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources

from experiments.commissioning.evidence.record import Measured


@dataclass(frozen=True, slots=True)
class Limit:
    """Between which values a quantity passes.

    Attributes:
        name: of the quantity; may hold `{joint}`.
        unit: of all values; "" = a number of something.
        wrong: what is the matter beyond the limits; may hold `{joint}`.
        source: where the values come from.
        low: the least that passes; None = no such limit, or the judge computes it.
        high: the most that passes; None as for `low`.
    """

    name: str
    unit: str
    wrong: str
    source: str
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True, slots=True)
class Found:
    """A quantity and what is the matter where it does not pass.

    Attributes:
        measured: the quantity with its limits.
        wrong: the matter.
    """

    measured: Measured
    wrong: str


@dataclass(frozen=True, slots=True)
class Judgement:
    """What came of a step.

    Attributes:
        quantities: in the order in which they were judged.
        cause: the first contradiction, in words; "" = none.
        notes: what is not as expected and keeps nobody from going on, in words.
    """

    quantities: tuple[Measured, ...]
    cause: str
    notes: tuple[str, ...] = ()


def _read_limits() -> dict[str, Limit]:
    """Return every limit by its name in limits.toml, which is used once."""
    path = resources.files("experiments.commissioning") / "limits.toml"
    text = path.read_text("utf-8")
    steps: dict[str, dict[str, dict[str, str | float]]] = tomllib.loads(text)
    rows = [row for step in steps.values() for row in step.items()]
    limits = {name: Limit(**fields) for name, fields in rows}  # pyright: ignore[reportArgumentType]
    if len(limits) != len(rows):
        raise ValueError("limits.toml has a name twice")
    return limits


LIMITS: Mapping[str, Limit] = _read_limits()


def found(
    key: str,
    value: float,
    *,
    low: float | None = None,
    high: float | None = None,
    **fields: object,
) -> Found:
    """Return a quantity beside its limits.

    Args:
        key: of `LIMITS`.
        value: as measured.
        low: in place of the least there, where it differs by joint.
        high: in place of the most there.
        fields: what its words hold.
    """
    limit = LIMITS[key]
    measured = Measured(
        name=limit.name.format(**fields),
        value=float(value),
        unit=limit.unit,
        low=limit.low if low is None else low,
        high=limit.high if high is None else high,
    )
    return Found(measured, limit.wrong.format(**fields) if fields else limit.wrong)


def judged(rows: Sequence[Found], notes: Sequence[str] = ()) -> Judgement:
    """Return what a step's quantities say together; the first that fails is named."""
    first = next((row for row in rows if not row.measured.is_within), None)
    cause = "" if first is None else f"{first.measured.text}. {first.wrong}"
    quantities = tuple(row.measured for row in rows)
    return Judgement(quantities, cause[:400], tuple(notes))
