"""Sessions on a real CAN socket: whole, with one seed twice, over a bad adapter."""

from lab.guest.commands import Program
from lab.guest.machine_room import CAN, FAR_CAN, MachineRoom
from lab.guest.network import clear, disturb, queue_length, set_up_both
from lab.guest.promises import hold_to
from lab.guest.scenarios.bus import Figures, figure
from lab.guest.sessions import begin, cycle_figures, require_rejected, verify_kept
from lab.guest.ways import farthest, way_of

PATIENCE = 60.0  # s of guest time for the end of a session


def served_arm(room: MachineRoom, *options: str) -> Program:
    """Return the arm above the container, its sensor on the bus."""
    set_up_both(room.shell)
    room.write_bus_config()
    return room.serve_pushed_arm(*options)


def three_trials(room: MachineRoom) -> Figures:
    """Record three trials with a pause, and compare the ways of two with one seed.

    The simulated hand wavers from the instant at which a trial is prepared, and a key
    comes when it comes: one seed is one ground, and not one way. How far apart the ways
    are is a figure, without a limit.
    """
    session = begin(room, served_arm(room), 3)
    session.await_ready()
    session.record(1)
    session.keep()
    session.another()
    session.pause()
    session.record(1)
    session.keep()
    session.another()
    session.record(2)
    session.keep()
    session.end()
    first, again, other = (way_of(path) for path in verify_kept(room, 3))
    same, different = farthest(first, again), farthest(first, other)
    return {
        "one seed": f"{same * 1e3:.2f} mrad apart",
        "another": f"{different * 1e3:.2f} mrad",
        **cycle_figures(room),
    }


def bad_adapter(room: MachineRoom) -> Figures:
    """Record a trial over a slow adapter, and one whose replies get lost."""
    arm = served_arm(room)
    queue = queue_length(room.shell, CAN)
    disturb(room.shell, CAN, "delay 600us")
    session = begin(room, arm, 2)
    session.await_ready()
    page = session.program.output
    session.record(1)
    session.keep()
    session.another()
    clear(room.shell, CAN)
    disturb(room.shell, FAR_CAN, "loss 0.2%")
    session.record(2)
    session.keep()
    code = session.ended()
    clear(room.shell, FAR_CAN)
    for fault in ("reply-late", "reply-lost-some"):
        hold_to(fault, "recording", code)
    verify_kept(room, 2)
    require_rejected(room, 0)
    slow = figure(page, r"7 positions after ([^,]+, \d+ incomplete)")
    return {"queue": str(queue), "slow exchange": slow, **cycle_figures(room)}
