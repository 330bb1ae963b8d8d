"""The file of `--can-log`: every frame of the bus as text."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from acquisition.clock import Clock
from acquisition.errors import SettingsError
from experiments.operator.console import WARNING, Console
from wam.bus.log import CanLog

if TYPE_CHECKING:
    from experiments.rig.rig import Rig

_BUFFER = 1 << 16  # bytes: a killed program loses less than a second of the log


@contextmanager
def open_bus_log(
    path: Path | None, clock: Clock, channel: str, console: Console
) -> Generator[CanLog | None]:
    """Open the log at `path`; yields None if there is no path.

    Raises:
        SettingsError: the file cannot be created, or is not empty.
    """
    if path is None:
        yield None
        return
    try:
        if path.exists() and path.stat().st_size:
            raise SettingsError(
                f"{path} exists and is not empty.",
                hint="Choose another name for --can-log. Nothing was started.",
            )
        file = path.open("w", encoding="ascii", buffering=_BUFFER)
    except OSError as error:
        raise SettingsError(
            f"--can-log {path} cannot be written: {error.strerror or error}.",
            hint="Choose another name. Nothing was started.",
        ) from error
    log = CanLog(file.write, clock, channel)
    try:
        yield log
    finally:
        log.flush()
        failure = log.failure
        try:
            file.close()
        except OSError as error:
            failure = failure or error.strerror or str(error)
        if failure:
            console.say(f"{WARNING} The bus log {path} ends early: {failure}.")


@contextmanager
def logging_bus(rig: Rig, path: Path | None, console: Console) -> Generator[None]:
    """Log the bus of `rig` to `path`; closes the rig at the end.

    Raises:
        SettingsError: as `open_bus_log`.
    """
    channel = "fake0" if rig.is_simulated else rig.settings.rig.can.channel
    reader = rig.shared.frames.reader()

    def drain(log: CanLog) -> None:
        for frame in reader.read():
            length = int(frame["length"])
            data = frame["data"].tobytes()[:length]
            log.add(int(frame["can_id"]), data, int(frame["t_ns"]))

    with (
        closing(rig.backend),  # closed even if the log cannot be opened
        open_bus_log(path, rig.clock, channel, console) as log,
    ):
        if log is not None:
            rig.backend.loop_client.on_tick.append(lambda: drain(log))
        try:
            yield
        finally:
            rig.backend.close()  # its last frames are logged
            if log is not None:
                drain(log)
            if reader.lost:
                console.say(f"{WARNING} {reader.lost} frames are not in the bus log.")
