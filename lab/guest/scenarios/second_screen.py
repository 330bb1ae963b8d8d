"""A second screen beside a session: how late the loop's cycles are with and without."""

import signal

from lab.guest import viewer
from lab.guest.commands import Program, wait
from lab.guest.lateness import lateness, memory_of, require_on_time
from lab.guest.machine_room import MachineRoom
from lab.guest.scenarios.bus import Figures, figure
from lab.guest.scenarios.recording import served_arm
from lab.guest.sessions import begin, cycle_figures, verify_kept

_SETTLING = 1.0  # s, in which programs start
_PATIENCE = 60.0  # s until a program has read from the host what it needs


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

    The machine has one processor, which loop, recorder, server, viewer and the relay to
    the simulated arm share. Before the last window the server is killed with -9.
    """
    session = begin(room, served_arm(room), 1)
    session.await_ready()
    shared = memory_of(session.program.pid)
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
    figures = require_on_time(watched, alone, {"killed": killed})
    return {**figures, **cycle_figures(room)}
