"""Lost replies and a link that goes down, in one session."""

from lab.guest.commands import Program
from lab.guest.machine_room import CAN, FAR_CAN, MachineRoom
from lab.guest.network import clear, disturb, set_up_both
from lab.guest.promises import require_promised
from lab.guest.scenarios.bus import Figures, figure
from lab.guest.sessions import (
    begin,
    cycle_figures,
    require_rejected,
    verify_kept,
)


def served_arm(room: MachineRoom, *options: str) -> Program:
    """Start the arm above the container, its sensor on the bus."""
    set_up_both(room.shell)
    room.write_bus_config()
    return room.serve_pushed_arm(*options)


def lossy_and_down(room: MachineRoom) -> Figures:
    """Record a trial with lost replies; in the next trial can0 goes down.

    A controller in the bus-off state refuses to send and receive, like a link that is
    down; the emulated bus has no errors that lead to bus-off.
    """
    arm = served_arm(room)
    session = begin(room, arm, 2)
    session.await_ready()
    disturb(room.shell, FAR_CAN, "loss 0.2%")
    session.record(1)
    session.keep()
    session.another()
    clear(room.shell, FAR_CAN)
    session.record(2)
    room.shell.run(f"ip link set {CAN} down")
    code = session.cut_off()
    require_promised("interface-down", "recording", code)
    message = figure(session.program.output, r"(?m)^((?!.*floating).*ARM: .*)$")
    verify_kept(room, 1)
    require_rejected(room, 1)
    return {"exit code": str(code), "said": message, **cycle_figures(room)}
