"""A recorded trial shown again: the live screen, from the file; nothing moves."""

from collections.abc import Iterator
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from acquisition import MOTOR_FRESH_SHIFT, NS_PER_S, RATE_HZ, Clock, Flag, parse_toml
from acquisition.trial_file import TrialReader
from analysis.data import RecordedTrial, load_trial
from experiments.operator import Console, LiveScales, RecordingView, recording_lines

_PICTURES = 8  # per second of the person's time
_LINES = 1.0  # seconds of the trial between two lines without a terminal
_HISTORY = 5.0  # s of traction in the sparklines
_ALL_MOTORS = 0x7F << MOTOR_FRESH_SHIFT


def play(path: Path, speed: float, clock: Clock, console: Console) -> None:
    """Show the trial in `path`, `speed` times as fast as it was.

    Raises:
        TrialFileError: the file is no sound trial.
    """
    trial = load_trial(path)
    start_ns = clock.now_ns()
    scales = _scales_of(path)
    step = speed / _PICTURES if console.is_live else _LINES
    for row in _rows(trial, step):
        due_ns = start_ns + round(float(trial.t[row]) / speed * NS_PER_S)
        clock.sleep_until(due_ns)
        if console.is_lost:
            return
        view = replace(_view(trial, row), scales=scales)
        lines = recording_lines(view, console.width)[:-2]
        if console.is_live:
            console.panel(lines)
        else:
            console.say(_line(trial, row))
    console.end_panel()
    if console.is_live:
        console.say(_line(trial, len(trial.t) - 1))


def _scales_of(path: Path) -> LiveScales:
    """Return the scales of the limits that were set when it was recorded."""
    config = TrialReader(path).attachments.get("config.toml", b"")
    try:
        limits: Any = parse_toml(config.decode()).get("limits", {})
    except ValueError:
        return LiveScales()
    known = {
        field.name: float(limits[field.name])
        for field in fields(LiveScales)
        if isinstance(limits.get(field.name), float | int) and limits[field.name] > 0
    }
    return LiveScales(**known)


def _rows(trial: RecordedTrial, step: float) -> Iterator[int]:
    """Give the rows of the trial at every `step` seconds, the last one included."""
    last = len(trial.t) - 1
    at = 0.0
    while (row := int(np.searchsorted(trial.t, at))) < last:
        yield row
        at += step
    yield last


def _view(trial: RecordedTrial, row: int) -> RecordingView:
    first = int(np.searchsorted(trial.t, float(trial.t[row]) - _HISTORY))
    before = max(0, row - RATE_HZ)
    span = float(trial.t[row] - trial.t[before])
    flags = int(trial.cycles["flags"][row])
    missed = int(trial.cycles["cycle"][row]) - int(trial.cycles["cycle"][0]) - row
    return RecordingView(
        trial=trial.name,
        seconds=float(trial.t[row]),
        displacement=float(trial.displacement[row]),
        travel=trial.frame.travel,
        rate=(row - before) / span if span > 0 else 0.0,
        missed=missed,
        is_arm_fine=flags & _ALL_MOTORS == _ALL_MOTORS,
        is_sensor_fine=bool(flags & Flag.FT_FRESH) and not flags & Flag.FT_SATURATED,
        traction=trial.traction[first : row + 1],
    )


def _line(trial: RecordedTrial, row: int) -> str:
    v_t, F_t, F_n = trial.traction[row].tolist()
    return (
        f"▶ {trial.name}  {trial.t[row]:5.2f} s  {trial.displacement[row]:.2f} of "
        f"{trial.frame.travel:.2f} m  F_n {F_n:.1f} N  F_t {F_t:.1f} N  "
        f"v_t {v_t:.3f} m/s"
    )
