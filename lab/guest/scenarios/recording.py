"""Sessions on a real CAN socket: whole, killed, cut off from the arm."""

import signal
from collections.abc import Callable

from lab.guest.commands import Program, require
from lab.guest.machine_room import CAN, MachineRoom
from lab.guest.monitor import CARD, Monitor
from lab.guest.network import NET, set_up, set_up_both
from lab.guest.scenarios.bus import Figures, figure
from lab.guest.sessions import (
    LedSession,
    begin,
    cycle_figures,
    resume,
    session_folder,
    verify_kept,
)

_INTO_TRIAL = 1.0  # s
_BRAKED = 3.0  # s until the arm is braked by the process that outlives the console
_ENDED = 30.0  # s until a session that lost its arm has ended
_FAULT_CODE = 4


def _room_with_arm(room: MachineRoom) -> Program:
    set_up_both(room.shell)
    room.write_bus_config()
    return room.serve_pushed_arm()


def three_trials(room: MachineRoom) -> Figures:
    """Record a session of three trials with a pause before the second."""
    arm = _room_with_arm(room)
    session = begin(room, arm, 3)
    session.trial(1)
    session.make_ready(2)
    session.pause()
    session.record()
    session.keep()
    session.trial(3)
    session.end()
    verify_kept(room, 3)
    return cycle_figures(room)


def killed_console(room: MachineRoom) -> Figures:
    """Kill -9 the console in a trial; the file is ended, resume goes on."""
    arm = _room_with_arm(room)
    session = begin(room, arm, 1)
    session.make_ready(1)
    session.record()
    session.program.run_on(_INTO_TRIAL)
    session.program.signal(signal.SIGKILL)
    session.program.run_on(_BRAKED)
    require(not session.program.is_running, "the console is still there")
    return _resume_after(room, arm)


def link_down(room: MachineRoom) -> Figures:
    """Take can0 down in a trial, up again; the session ends, resume goes on."""

    def cut(session: LedSession) -> None:
        room.shell.run(f"ip link set {CAN} down")

    return _cut_off(room, cut, lambda: set_up(room.shell, CAN))


def card_out(room: MachineRoom) -> Figures:
    """Pull the CAN card out of its slot in a trial, put it in; resume goes on."""
    monitor = Monitor(room)
    node = NET / CAN

    def cut(session: LedSession) -> None:
        monitor.pull_out(CARD, node)

    def mend() -> None:
        monitor.put_in(CARD, node)
        set_up(room.shell, CAN)

    try:
        return _cut_off(room, cut, mend)
    finally:
        monitor.close()


def link_down_before_activation(room: MachineRoom) -> Figures:
    """Take can0 down before the arm is activated: refused, resume goes on."""
    arm = _room_with_arm(room)
    program = room.traction("run", "TF", "--trials", "1")
    program.expect("Press Shift-activate", 60.0)
    room.shell.run(f"ip link set {CAN} down")
    code = program.wait(_ENDED)
    require(code in {3, _FAULT_CODE}, f"exit code {code}")
    set_up(room.shell, CAN)
    return {"exit code": str(code), **_resume_after(room, arm)}


def link_down_while_ready(room: MachineRoom) -> Figures:
    """Take can0 down between two trials; the session ends, resume goes on."""
    arm = _room_with_arm(room)
    session = begin(room, arm, 1)
    session.make_ready(1)
    room.shell.run(f"ip link set {CAN} down")
    room.finish(session.program, _ENDED, _FAULT_CODE)
    set_up(room.shell, CAN)
    return _resume_after(room, arm)


def _cut_off(
    room: MachineRoom, cut: Callable[[LedSession], None], mend: Callable[[], None]
) -> Figures:
    """Cut the arm off in a trial, as `cut` does; `mend` it and resume."""
    arm = _room_with_arm(room)
    session = begin(room, arm, 1)
    session.make_ready(1)
    session.record()
    session.program.run_on(_INTO_TRIAL)
    cut(session)
    output = room.finish(session.program, _ENDED, _FAULT_CODE)
    mend()
    said = figure(output, r"(?m)^((?!.*floating).*ARM: .*)$")
    return {"said": said, **_resume_after(room, arm)}


def _resume_after(room: MachineRoom, arm: Program) -> Figures:
    arm.press("mend\n")
    arm.press("idle\n")
    session = resume(room, arm)
    session.trial(1)
    session.end()
    verify_kept(room, 1)
    rejected = len(list((session_folder(room) / "rejected").glob("T???.mcap")))
    return {"rejected": str(rejected), **cycle_figures(room)}
