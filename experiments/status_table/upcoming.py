"""What comes next: sessions to be resumed, terrains that have enough, a good order."""

from __future__ import annotations

import math
import os
import random
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

from acquisition.errors import TrialFileError
from experiments.arguments import data_option
from experiments.session.lock import owner_of
from experiments.status_table.table import counted_of, facts_of_row, is_of

if TYPE_CHECKING:
    from pathlib import Path

    from analysis.data.terrain_kinds import Value
    from experiments.status_table.session_summaries import SeenSession
    from experiments.status_table.summary_cache import StatusMatrix, StatusRow
    from experiments.status_table.where import Where

_DRAWS = 400  # orders


def next_steps(
    data: Path,
    seen: Sequence[SeenSession],
    matrix: StatusMatrix,
    where: Where,
    *,
    is_simulated: bool,
) -> list[str]:
    """Return what others have open, what is to be resumed, which terrain comes next.

    Args:
        data: the data folder.
        seen: all sessions in it.
        matrix: the terrains and their order.
        where: of the order only terrains with these values are told; it is made of all.
        is_simulated: of which kind of session.
    """
    own = [s for s in seen if s.summary.problem is None]
    own = [s for s in own if s.folder.is_simulated is is_simulated]
    steps = [text for text in map(_opened, own) if text]
    option = data_option(data)
    for session in own:
        text = _left(session) if session.summary.is_resumable else ""
        if text:
            number = session.folder.id
            steps.append(f"{text} To go on: traction resume {number}{option}")
    done = [s.folder.terrain for s in own]
    asked = {row.name for row in matrix.rows if where.matches(facts_of_row(row))}
    order = [name for name in suggest_order(matrix, done) if name in asked]
    if order:
        steps.append(f"{_ORDERS[matrix.order]}: {_listed(order)}")
    return steps


_ORDERS = {
    "randomised": "Suggested order, randomised against drift",
    "blocked": "Suggested order, in blocks, randomised against drift",
    "rows": "Next, as the rows stand",
}
_SHOWN = 12  # terrains of an order


def _listed(order: Sequence[str]) -> str:
    more = f" and {len(order) - _SHOWN} more" if order[_SHOWN:] else ""
    return " ".join(order[:_SHOWN]) + more


def _opened(session: SeenSession) -> str:
    """Return by which other process a session is open; empty for none."""
    owner = owner_of(session.folder)
    if owner is None or owner.pid == os.getpid():
        return ""
    return (
        f"{session.folder.id} {session.folder.terrain} is open in process {owner.pid} "
        f"since {owner.since} UTC: {session.summary.phase}."
    )


def _left(session: SeenSession) -> str:
    """Return what there is to be resumed of a session; empty for nothing."""
    from experiments.session.unfinished import inspect_session

    with suppress(OSError, TrialFileError):
        unfinished = inspect_session(session.folder)
        return "" if unfinished is None else unfinished.text()
    return ""


def enough_lines(
    seen: Sequence[SeenSession], rows: Sequence[StatusRow], where: Where
) -> list[str]:
    """Return the terrains whose kept trials are enough for their target.

    Nothing is said, nor read, of one of which as many are kept as are wanted.

    Args:
        seen: the sessions.
        rows: the terrains and their targets.
        where: only these, as in `count_rows`.
    """
    lines: list[str] = []
    sessions = counted_of(seen, where)
    for row in rows:
        if not where.matches(facts_of_row(row)):
            continue
        for is_simulated in (False, True):
            own = [s for s in sessions if is_of(s, row, is_simulated=is_simulated)]
            if 0 < sum(s.summary.pushes for s in own) < row.trials:
                lines.append(_enough(own, row))
    return [text for text in lines if text]


def _enough(own: Sequence[SeenSession], row: StatusRow) -> str:
    from experiments.session.kept_files import enough_of

    return enough_of([s.folder for s in own], row)


def suggest_order(matrix: StatusMatrix, done: Sequence[str]) -> list[str]:
    """Return the terrains still to be recorded in a good order.

    A foot that wears, a sensor that drifts and a person who learns change with time.
    If the inclines came in rising order, these could not be told from the incline. So
    of many random orders that one is taken in which the factors go least with the
    position in the whole sequence. What is hard to change is done in one go; cells that
    are recorded again come when all have been recorded as often.

    Args:
        matrix: the matrix.
        done: names of the terrains recorded so far, oldest first.
    """
    rows = {row.name: row for row in matrix.rows}
    begun = [name for name in done if name in rows]
    times = Counter(begun)
    least = min((times[name] for name in rows), default=0)
    rest = [
        name
        for name, row in rows.items()
        if times[name] == least and least < row.blocks
    ]
    if not rest or matrix.order == "rows":
        return rest
    columns = _columns([*begun, *rest], factor_columns(matrix), len(begun))
    dice = random.Random(matrix.seed)
    blocks = _blocks(matrix, rest, begun)
    orders = [_drawn(dice, blocks) for _ in range(_DRAWS)]
    return min(
        orders,
        key=lambda order: max((c.correlation(order) for c in columns), default=0),
    )


def _blocks(
    matrix: StatusMatrix, rest: Sequence[str], begun: Sequence[str]
) -> list[list[str]]:
    """Return the terrains by what is hard to change; that of the last one first."""
    if matrix.order != "blocked":
        return [list(rest)]
    facts = {row.name: facts_of_row(row) for row in matrix.rows}

    def hard(name: str) -> tuple[Value, ...]:
        return tuple(facts[name].get(key) for key in matrix.block_by)

    blocks: dict[tuple[Value, ...], list[str]] = {}
    if begun and any(hard(name) == hard(begun[-1]) for name in rest):
        blocks[hard(begun[-1])] = []
    for name in rest:
        blocks.setdefault(hard(name), []).append(name)
    is_open = bool(begun) and hard(begun[-1]) in blocks
    first = blocks.pop(hard(begun[-1])) if is_open else []
    return [first, *blocks.values()]


def _drawn(dice: random.Random, blocks: Sequence[Sequence[str]]) -> list[str]:
    """Return a random order; the first block stays the first."""
    first, *others = blocks
    shuffled = dice.sample(others, len(others))
    return [
        name for block in (first, *shuffled) for name in dice.sample(block, len(block))
    ]


def confounding(order: Sequence[str], factors: Mapping[str, Sequence[float]]) -> float:
    """Return the largest |correlation| of a factor with the position in `order`."""
    columns = _columns(order, factors, 0)
    return max((column.correlation(order) for column in columns), default=0.0)


@dataclass(frozen=True, slots=True)
class _Column:
    """One factor of the terrains in a sequence whose beginning is fixed.

    Attributes:
        centred: the factor less its mean, by the name of the terrain.
        size: its spread times that of the positions in the sequence.
        positions: those that are still to be filled, less the mean of all.
        begun: sum of the products of position and factor at the beginning.
    """

    centred: Mapping[str, float]
    size: float
    positions: Sequence[float]
    begun: float

    def correlation(self, order: Sequence[str]) -> float:
        """Return |correlation| with the position if the rest comes in this order."""
        own = [p * self.centred[n] for p, n in zip(self.positions, order, strict=True)]
        return abs(math.fsum((self.begun, *own))) / self.size


def _columns(
    order: Sequence[str], factors: Mapping[str, Sequence[float]], begun: int
) -> list[_Column]:
    """Return the factors that vary; the first `begun` terrains keep their positions."""
    count = len(order)
    positions = [position - (count - 1) / 2 for position in range(count)]
    squares = math.fsum(p * p for p in positions)
    columns: list[_Column] = []
    for values in zip(*(factors[name] for name in order), strict=True):
        mean = math.fsum(values) / count
        centred = [value - mean for value in values]
        size = math.sqrt(math.fsum(c * c for c in centred) * squares)
        if size > 0.0:
            pairs = zip(positions[:begun], centred[:begun], strict=True)
            first = math.fsum(p * c for p, c in pairs)
            named = dict(zip(order, centred, strict=True))
            columns.append(_Column(named, size, positions[begun:], first))
    return columns


def factor_columns(matrix: StatusMatrix) -> dict[str, tuple[float, ...]]:
    """Return what tells the terrains apart as numbers, by name; all equally long.

    A number is itself, or its logarithm; a word is 0 or 1 for every level but the
    first, and so is whether a number applies.
    """
    facts = [
        {**facts_of_row(row), "terrain": None, "place": None} for row in matrix.rows
    ]
    if "d50" in facts[0]:  # says the same as the size of the stones
        facts = [{**each, "stones": None} for each in facts]
    columns: list[list[float]] = []
    for key in facts[0]:
        values = [each[key] for each in facts]
        words = list(dict.fromkeys(v for v in values if not isinstance(v, float)))
        is_mixed = len(words) < len(set(values))
        columns += [
            [float(value == word) for value in values]
            for word in (words if is_mixed else words[1:])
        ]
        numbers = [v for v in values if isinstance(v, float)]
        if numbers:
            scale = math.log if key in matrix.logs else float
            mean = math.fsum(map(scale, numbers)) / len(numbers)
            columns.append([scale(v) if isinstance(v, float) else mean for v in values])
    names = [row.name for row in matrix.rows]
    return dict(zip(names, zip(*columns, strict=True), strict=True))
