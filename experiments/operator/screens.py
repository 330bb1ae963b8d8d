"""Screens as lines of text; pure functions."""

from dataclasses import dataclass
from math import ceil

import numpy as np
from numpy.typing import NDArray

from experiments.operator.graphs import (
    BarScale,
    KeptRow,
    LiveScales,
    kept_table,
    sparkline,
)
from experiments.operator.keys import STOP_KEYS, screen_keys
from experiments.operator.prompts import Prompt

_WIDEST = 60  # characters of a sparkline
_TABLE_ROWS = 10  # rows of the running table


@dataclass(frozen=True, slots=True)
class RecordingView:
    """Content of the screen of a running trial.

    Attributes:
        trial: name of the trial.
        seconds: time since the start [s].
        displacement: displacement of the foot along the container [m].
        travel: length of the container [m].
        rate: cycle rate over the last second [Hz].
        missed: missed cycles of this trial.
        is_arm_fine: whether every motor answered in the last cycle.
        is_sensor_fine: whether the last force sample was fresh and in range.
        traction: v_t, F_t, F_n of the last seconds [m/s, N, N], shape (n, 3).
        scales: scales of the bars.
    """

    trial: str
    seconds: float
    displacement: float
    travel: float
    rate: float
    missed: int
    is_arm_fine: bool
    is_sensor_fine: bool
    traction: NDArray[np.float64]
    scales: LiveScales


def recording_lines(view: RecordingView, width: int) -> list[str]:
    """Return the screen of a running trial for a terminal of `width` characters."""
    newest = view.traction[-1] if len(view.traction) else np.zeros(3)
    rows = (
        ("F_n", 2, view.scales.F_n),
        ("F_t", 1, view.scales.F_t),
        ("v_t", 0, view.scales.v_t),
    )
    return [
        f"● REC {view.trial}  {view.seconds:04.1f} s  {view.displacement:.2f} of "
        f"{view.travel:.2f} m  {view.rate:.1f} Hz  missed {view.missed}  "
        f"CAN {_fine(view.is_arm_fine)}  F/T {_fine(view.is_sensor_fine)}",
        *(
            _bar_line(name, view.traction[:, column], float(newest[column]), width, s)
            for name, column, s in rows
        ),
        screen_keys(Prompt.RECORDING),
        STOP_KEYS,
    ]


def _bar_line(
    name: str,
    values: NDArray[np.float64],
    newest: float,
    width: int,
    scale: BarScale,
) -> str:
    """Return the bars from 0 to the limit, the newest value and its band."""
    limit, number = f"{scale.limit:g}", scale.number(newest)
    words = f"{number:>10}  {scale.band_words(newest)}"
    room = width - len(name) - len(limit) - len(words) - 5
    bars = sparkline(values, max(1, min(room, _WIDEST)), scale)
    return f"{name} 0{bars}{limit}  {words}"


def live_line(
    trial: str,
    where: tuple[float, float, float],
    traction: tuple[float, float, float],
    late: int,
) -> str:
    """Return a running trial in one line, for output without a panel.

    Args:
        trial: name of the trial.
        where: time since the start [s], displacement and travel [m].
        traction: v_t, F_t, F_n [m/s, N, N].
        late: number of late cycles.
    """
    seconds, displacement, travel = where
    v_t, F_t, F_n = traction
    return (
        f"● REC {trial}  {seconds:4.1f} s  {displacement:.2f} of {travel:.2f} m  "
        f"F_n {F_n:.1f} N  F_t {F_t:.1f} N  v_t {v_t:.3f} m/s  late {late}"
    )


@dataclass(frozen=True, slots=True)
class ReadyView:
    """Content of the screen between two trials.

    Attributes:
        session: id of the session.
        terrain: name of the terrain.
        trial: number of the next trial.
        wanted: number of trials to keep.
        kept: number of kept trials.
        rejected: number of rejected attempts.
        elapsed: time since the session was opened [s].
        left: expected time for the missing trials [s]; None = unknown yet.
        reset: steps that restore the terrain before each trial.
        ticked: numbers of the steps of `reset` that are done, from 1.
        thin: cell of speed and load with the fewest samples; empty for none.
        table: the kept trials, oldest first.
        given: newest verdict while it can be undone; empty afterwards.
        undo_left: remaining time to undo it [s].
    """

    session: str
    terrain: str
    trial: int
    wanted: int
    kept: int
    rejected: int
    elapsed: float
    left: float | None
    reset: tuple[str, ...]
    thin: str
    ticked: frozenset[int] = frozenset()
    table: tuple[KeptRow, ...] = ()
    given: str = ""
    undo_left: float = 0.0


def ready_lines(view: ReadyView, width: int = 80) -> list[str]:
    """Return the screen between two trials for a terminal of `width` characters."""
    left = "" if view.left is None else f" · left about {ceil(view.left / 60)} min"
    lines = [
        f"ARM: floating  {view.session} {view.terrain} · trial {view.trial} of "
        f"{view.wanted} · kept {view.kept} · rejected {view.rejected}",
        f"Elapsed {_clock(view.elapsed)}{left}",
        *kept_table(view.table, width, _TABLE_ROWS),
    ]
    if view.reset:
        boxes = enumerate(view.reset, 1)
        steps = (f"{n} {'☑' if n in view.ticked else '☐'} {s}" for n, s in boxes)
        lines.append("Reset (its digit ticks a step):  " + "  ".join(steps))
    if view.thin:
        lines.append(f"Thin so far: {view.thin}")
    if view.given and view.undo_left > 0.0:
        lines.append(f"{view.given}.  [u]ndo ({ceil(view.undo_left)} s)")
    return lines


@dataclass(frozen=True, slots=True)
class EndView:
    """Content of the page at the end of a session.

    Attributes:
        session: id of the session.
        terrain: name of the terrain.
        kept: number of kept trials.
        wanted: number of trials to keep.
        rejected: number of rejected attempts.
        elapsed: duration of this opening [s].
        estimate: duration as estimated after the first kept trial [s].
        drift: drift of the force between first and last tare [N]; empty = unknown.
    """

    session: str
    terrain: str
    kept: int
    wanted: int
    rejected: int
    elapsed: float
    estimate: float | None
    drift: tuple[float, ...]


def end_lines(view: EndView) -> list[str]:
    """Return the page at the end of a session."""
    estimate = ""
    if view.estimate is not None:
        estimate = f" · estimated after the first trial: {_clock(view.estimate)}"
    lines = [
        f"{view.session} {view.terrain} · kept {view.kept} of {view.wanted} · rejected "
        f"{view.rejected}",
        f"Took {_clock(view.elapsed)}{estimate}",
    ]
    if view.drift:
        axes = "  ".join(
            f"{axis} {value:+z.2f}"
            for axis, value in zip(("fx", "fy", "fz"), view.drift, strict=True)
        )
        lines.append(f"Force drifted between first and last tare [N]: {axes}")
    return lines


def _fine(is_fine: bool) -> str:
    return "ok" if is_fine else "✘"


def _clock(seconds: float) -> str:
    minutes, whole_seconds = divmod(int(seconds), 60)
    return f"{minutes}:{whole_seconds:02d}"
