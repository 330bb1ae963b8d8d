"""A second screen beside a session: how late the loop's cycles are with and without."""

import signal

import numpy as np
from numpy.typing import NDArray

from acquisition.ipc import SharedLayout
from lab.guest import viewer
from lab.guest.commands import Program, require, wait
from lab.guest.machine_room import MachineRoom
from lab.guest.scenarios.bus import Figures, figure
from lab.guest.scenarios.recording import served_arm
from lab.guest.sessions import begin, cycle_figures, verify_kept

WINDOW = 2.0  # s
_SETTLING = 1.0  # s, in which programs start
_PATIENCE = 60.0  # s until a program has read from the host what it needs
_CYCLES_PER_S = 500
MOST_LATER = 3.0  # us, that a second screen may add to the 99 % quantile
Lateness = NDArray[np.float64]


def lateness(shared: SharedLayout) -> Lateness:
    """Return how late each cycle of a window began [us], shape (n,)."""
    wait(WINDOW)
    rows = shared.timings.last(round(WINDOW * _CYCLES_PER_S))
    late = rows["woke_ns"].astype(np.int64) - rows["deadline_ns"].astype(np.int64)
    return np.asarray(late * 1e-3, np.float64)


def _second_screen(room: MachineRoom) -> tuple[Program, Program]:
    """Return `traction watch` and a viewer that reads all of what it serves."""
    server = room.traction("watch", "--port", "0")
    server.expect("is on the screen", _PATIENCE)
    port = figure(server.output, r"ws://127\.0\.0\.1:(\d+)")
    client = room.start("viewer", port, run=viewer.main)
    client.expect("cycles", _PATIENCE)
    return server, client


def beside_a_session(room: MachineRoom) -> Figures:
    """Watch a session from a second screen: its loop may be 3 us later (p99), no more.

    The machine has one processor, which loop, recorder, simulated arm, server and
    viewer share. Before the last window the server is killed with -9.
    """
    session = begin(room, served_arm(room), 1)
    session.await_ready()
    shared = SharedLayout.of_process(session.program.pid)
    require(shared is not None, "the session's memory is not found")
    assert shared is not None
    wait(_SETTLING)
    alone = lateness(shared)
    server, client = _second_screen(room)
    wait(_SETTLING)
    watched = lateness(shared)
    server.signal(signal.SIGKILL)
    killed = lateness(shared)
    shared.close()
    client.wait(_PATIENCE)
    session.record()
    session.keep()
    session.end()
    verify_kept(room, 1)
    later = float(np.quantile(watched, 0.99) - np.quantile(alone, 0.99))
    windows = {"alone": alone, "watched": watched, "killed": killed}
    figures = {name: _words(window) for name, window in windows.items()}
    require(later <= MOST_LATER, f"p99 {later:.1f} us later: {figures}")
    return {**figures, **cycle_figures(room)}


def _words(late: Lateness) -> str:
    low, high = np.quantile(late, [0.5, 0.99])
    return f"p50 {low:.1f} us, p99 {high:.1f} us, worst {late.max():.1f} us"
