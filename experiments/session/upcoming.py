"""Next steps: sessions to resume, and the suggested order of terrains."""

from __future__ import annotations

import os
import random
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

from acquisition.errors import TrialFileError
from experiments.arguments import data_option
from experiments.session.lock import owner_of
from experiments.session.status_table import facts_of_row

if TYPE_CHECKING:
    from pathlib import Path

    from analysis.data.terrain_kinds import Value
    from experiments.session.summaries import SessionEntry
    from experiments.session.where import Where
    from experiments.settings.matrix import MatrixSettings, TerrainRow


def next_steps(
    data: Path,
    seen: Sequence[SessionEntry],
    matrix: MatrixSettings,
    where: Where,
    *,
    is_simulated: bool,
) -> list[str]:
    """Return lines on sessions open elsewhere, sessions to resume, and next terrains.

    Args:
        data: the data folder.
        seen: all sessions in it.
        matrix: the terrains and their order.
        where: conditions on the terrains shown; the order is that of all terrains.
        is_simulated: kind of sessions.
    """
    own = [s for s in seen if s.summary.problem is None]
    own = [s for s in own if s.folder.is_simulated is is_simulated]
    steps = [text for text in map(_open_elsewhere, own) if text]
    option = data_option(data)
    for session in own:
        text = _resumable(session) if session.summary.is_resumable else ""
        if text:
            number = session.folder.id
            steps.append(f"{text} To go on: traction resume {number}{option}")
    done = [s.folder.terrain for s in own]
    asked = {row.name for row in matrix.terrains if where.matches(facts_of_row(row))}
    order = [name for name in suggest_order(matrix, done) if name in asked]
    if order:
        steps.append(f"{_ORDERS[matrix.design.order]}: {_order_text(order)}")
    return steps


_ORDERS = {
    "randomised": "Suggested order, randomised against drift",
    "blocked": "Suggested order, in blocks, randomised against drift",
    "rows": "Next, as the rows stand",
}
_SHOWN = 12  # terrains of an order


def _order_text(order: Sequence[str]) -> str:
    more = f" and {len(order) - _SHOWN} more" if order[_SHOWN:] else ""
    return " ".join(order[:_SHOWN]) + more


def _open_elsewhere(session: SessionEntry) -> str:
    """Line on the other process that has a session open; empty if none has."""
    owner = owner_of(session.folder)
    if owner is None or owner.pid == os.getpid():
        return ""
    return (
        f"{session.folder.id} {session.folder.terrain} is open in process {owner.pid} "
        f"since {owner.since} UTC: {session.summary.phase}."
    )


def _resumable(session: SessionEntry) -> str:
    """Line on a session to resume; empty if it cannot be resumed."""
    from experiments.session.unfinished import inspect_session

    with suppress(OSError, TrialFileError):
        unfinished = inspect_session(session.folder)
        return "" if unfinished is None else unfinished.text()
    return ""


def suggest_order(matrix: MatrixSettings, done: Sequence[str]) -> list[str]:
    """Return the terrains to record, in the random order of the matrix.

    Wear of the foot, drift of the sensor and learning of the operator change with time;
    in rising order of inclines they would be confounded with the incline. The seed of
    the matrix decides the order. Terrains that share a hard-to-change factor form a
    block, beginning with that of the last session; a repetition starts once all cells
    have been recorded equally often.

    Args:
        matrix: the matrix.
        done: names of the terrains recorded so far, oldest first.
    """
    rows = {row.name: row for row in matrix.terrains}
    recorded = [name for name in done if name in rows]
    times, design = Counter(recorded), matrix.design
    least = min(times[name] for name in rows)
    if least > design.repeat_blocks:
        return []
    order = list(rows)
    if design.order != "rows":
        random.Random(design.seed + least).shuffle(order)
    if design.order == "blocked":
        hard = {name: _hard_factors(row, design.block_by) for name, row in rows.items()}
        first = [hard[recorded[-1]]] if recorded else []
        blocks = list(dict.fromkeys([*first, *(hard[name] for name in order)]))
        order.sort(key=lambda name: blocks.index(hard[name]))
    return [name for name in order if times[name] == least]


def _hard_factors(row: TerrainRow, block_by: Sequence[str]) -> tuple[Value, ...]:
    """Values of the hard-to-change factors of a terrain."""
    facts = facts_of_row(row)
    return tuple(facts.get(key) for key in block_by)
