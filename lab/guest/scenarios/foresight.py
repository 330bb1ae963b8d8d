"""Foresight beside a recording: how late the loop's cycles are with and without."""

import os
import signal
from contextlib import suppress
from pathlib import Path

import numpy as np

from acquisition.trial_file.reader import TrialReader
from lab.guest.commands import require, wait
from lab.guest.lateness import Lateness, lateness, memory_of, require_on_time
from lab.guest.machine_room import MachineRoom
from lab.guest.scenarios.bus import Figures
from lab.guest.scenarios.recording import served_arm
from lab.guest.sessions import LedSession, begin, cycle_figures, verify_kept

DATABASE = Path(__file__).parents[3] / "tests" / "data" / "lab" / "terrains.json"
_PROCESS = "traction-sight"
_SETTLING = 1.0  # s
_LEAST_KNOWN = 0.5  # of the states: where nothing is computed, nothing is late


def beside_a_recording(room: MachineRoom) -> Figures:
    """Record with foresight: the loop may be 3 us later (p99) than without, no more.

    Foresight is killed with -9 between two trials of one session; the second is
    recorded without it.
    """
    session = begin(room, served_arm(room), 2, "--foresight", str(DATABASE))
    session.await_ready()
    beside = _recorded(session, 1)
    session.keep()
    session.another()
    (pid,) = _pids(_PROCESS)
    os.kill(pid, signal.SIGKILL)
    wait(_SETTLING)
    alone = _recorded(session, 2)
    session.keep()
    session.end()
    foreseen, blind = (TrialReader(path).foresight() for path in verify_kept(room, 2))
    states = foreseen.data
    known = np.isfinite(states["slip_probability"]).sum()
    require(known >= _LEAST_KNOWN * len(states), f"{known} of {len(states)} states")
    require(len(blind.data) == 0, "something was foreseen in T02")
    figures = require_on_time(beside, alone, {})
    foresaw = f"{known} of {len(states)} with a probability of a slip"
    return {**figures, "states": foresaw, **cycle_figures(room)}


def _recorded(session: LedSession, number: int) -> Lateness:
    """Return how late cycles were while a trial was recorded."""
    shared = memory_of(session.program.pid)
    session.start_trial(number)
    late = lateness(shared)
    shared.close()
    return late


def _pids(name: str) -> list[int]:
    """Return the processes of a name."""
    found: list[int] = []
    for path in Path("/proc").glob("[0-9]*/comm"):
        with suppress(OSError):  # it has ended since
            if path.read_text().strip() == name:
                found.append(int(path.parent.name))
    return found
