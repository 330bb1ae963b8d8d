"""Playback of a recorded trial, on the screen or to viewers; nothing moves."""

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.clock import NS_PER_S, RATE_HZ, Clock
from acquisition.sample import MOTOR_FRESH_SHIFT, Flag
from acquisition.settings import parse_toml
from acquisition.trial_file.reader import TopicRows, TrialReader
from analysis.data.load import RecordedTrial, load_trial
from analysis.data.prepare import PrepareOptions
from experiments.commands.live.channels import (
    DESCRIPTION_TOPIC,
    LIVE_TOPICS,
    LiveEncoder,
)
from experiments.commands.live.server import (
    HOST,
    LiveServer,
    PlaybackRequest,
    layout_path,
)
from experiments.operator.console import Console
from experiments.operator.graphs import LiveScales
from experiments.operator.screens import RecordingView, recording_lines

_PICTURES = 8  # screen updates per second of real time
_LINES = 1.0  # s of the trial between lines without a terminal
_HISTORY = 5.0  # s of traction in the sparklines
_SERVE_NS = 20_000_000  # 50 Hz
_DESCRIBE_EVERY = 50  # the arm's URDF is sent every so many messages
_ALL_MOTORS = 0x7F << MOTOR_FRESH_SHIFT


def play(path: Path, speed: float, clock: Clock, console: Console) -> None:
    """Show the trial in `path` at `speed` times real time.

    Raises:
        TrialFileError: the file is no valid trial.
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
        view = _view(trial, row, scales)
        lines = recording_lines(view, console.width)[:-2]
        if console.is_live:
            console.panel(lines)
        else:
            console.say(_line(trial, row))
    console.end_panel()
    if console.is_live:
        console.say(_line(trial, len(trial.t) - 1))


def _scales_of(path: Path) -> LiveScales:
    """Return the scales for the limits in force at the recording."""
    window = PrepareOptions()
    used_speeds = (window.slowest, window.fastest)
    config = TrialReader(path).attachments.get("config.toml", b"")
    try:
        limits: Any = parse_toml(config.decode()).get("limits", {})
    except ValueError:
        return LiveScales(used_speeds)
    positive = {
        field.name: float(limits[field.name])
        for field in fields(LiveScales)
        if isinstance(limits.get(field.name), float | int) and limits[field.name] > 0
    }
    return LiveScales(used_speeds, **positive)


def _rows(trial: RecordedTrial, step: float) -> Iterator[int]:
    """Yield the rows of the trial every `step` seconds, including the last one."""
    last = len(trial.t) - 1
    at = 0.0
    while (row := int(np.searchsorted(trial.t, at))) < last:
        yield row
        at += step
    yield last


def _view(trial: RecordedTrial, row: int, scales: LiveScales) -> RecordingView:
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
        scales=scales,
    )


def _line(trial: RecordedTrial, row: int) -> str:
    v_t, F_t, F_n = trial.traction[row].tolist()
    return (
        f"▶ {trial.name}  {trial.t[row]:5.2f} s  {trial.displacement[row]:.2f} of "
        f"{trial.frame.travel:.2f} m  F_n {F_n:.1f} N  F_t {F_t:.1f} N  "
        f"v_t {v_t:.3f} m/s"
    )


@dataclass(slots=True)
class _Player:
    """State of a served playback.

    Attributes:
        t_ns: log times of the cycles [UTC ns], shape (n,).
        wish: present mode of playback.
        row: row of the last cycle sent.
    """

    t_ns: NDArray[np.int64]
    wish: PlaybackRequest
    row: int = -1
    _from: tuple[int, int] = (
        0,
        0,
    )  # real time [ns] and position [UTC ns] of the last change

    def follow(self, wish: PlaybackRequest, now_ns: int) -> None:
        """Change the mode of playback."""
        at = self.position(now_ns) if wish.seek_ns is None else wish.seek_ns
        at = min(max(at, int(self.t_ns[0])), int(self.t_ns[-1]))
        if wish.seek_ns is not None:
            self.row = int(np.searchsorted(self.t_ns, at)) - 1
        self.wish, self._from = wish, (now_ns, at)

    def position(self, now_ns: int) -> int:
        """Position of the playback [UTC ns]."""
        began_ns, at = self._from
        is_moving = self.wish.is_playing
        passed = round((now_ns - began_ns) * self.wish.speed) if is_moving else 0
        return min(at + passed, int(self.t_ns[-1]))

    def is_at_end(self) -> bool:
        """Whether the last cycle was sent."""
        return self.row >= len(self.t_ns) - 1


def serve(
    path: Path,
    speed: float,
    port: int,
    clock: Clock,
    console: Console,
    is_over: Callable[[], bool],
) -> None:
    """Serve the trial in `path` to viewers, which may pause and seek, until it is over.

    Raises:
        TrialFileError: the file is no valid trial.
        MissingLibraryError: foxglove-sdk is not installed.
        SettingsError: the port is taken.
    """
    reader = TrialReader(path)
    rows = reader.cycles()
    t_ns = rows.log_time.astype(np.int64)
    encoder = LiveEncoder(
        reader.attachments.get("robot.urdf", b"<robot/>").decode(errors="replace"),
        reader.attachments.get("config.toml", b"").decode(errors="replace"),
    )
    wishes: deque[PlaybackRequest] = deque()
    span = (int(t_ns[0]), int(t_ns[-1]))
    player = _Player(t_ns, PlaybackRequest(True, speed, None, None))
    server = LiveServer(port, LIVE_TOPICS, span_ns=span, hear=wishes.append)
    console.say(f"Serving {path.stem} at ws://{HOST}:{server.port}. Ctrl-C ends this.")
    console.say(f"Layout for the viewer: {layout_path()}")
    try:
        player.follow(replace(player.wish, seek_ns=span[0]), clock.now_ns())
        tick = 0
        while not is_over():
            now_ns = clock.now_ns()
            while wishes:
                player.follow(wishes.popleft(), now_ns)
                server.send_playback(
                    player.wish, player.position(now_ns), is_over=False
                )
            if tick % _DESCRIBE_EVERY == 0:
                described = {DESCRIPTION_TOPIC: encoder.description}
                server.publish(described, player.position(now_ns))
            tick += 1
            _send(server, player, rows, encoder, now_ns)
            clock.sleep_until(now_ns + _SERVE_NS)
    finally:
        server.close()


def _send(
    server: LiveServer,
    player: _Player,
    rows: TopicRows,
    encoder: LiveEncoder,
    now_ns: int,
) -> None:
    """Send the messages up to the position of the playback.

    Cycles are sent at 50 Hz of real time, the latest of each period.
    """
    at = player.position(now_ns)
    row = int(np.searchsorted(player.t_ns, at, side="right")) - 1
    if row <= player.row:
        return
    t_ns = int(player.t_ns[row])
    server.publish(encoder.messages(rows.data[row], t_ns), t_ns)
    server.send_time(t_ns)
    player.row = row
    if player.is_at_end():
        server.send_playback(player.wish, t_ns, is_over=True)
