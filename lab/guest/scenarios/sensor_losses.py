"""The wrist sensor lost in a trial: its adapter unplugged, its power switched."""

from lab.guest.commands import Program, wait
from lab.guest.machine_room import MachineRoom, line_port
from lab.guest.monitor import ADAPTER, Monitor
from lab.guest.network import set_up_both
from lab.guest.promises import hold_to
from lab.guest.scenarios.bus import Figures
from lab.guest.scenarios.recording import PATIENCE
from lab.guest.scenarios.serial_line import MAKES, PORT, write_make
from lab.guest.sessions import (
    LedSession,
    begin,
    cycle_figures,
    require_rejected,
    verify_kept,
)

_SETTLED = 1.0  # s until a sensor that came back is read again
_SWITCHED = 0.5  # s without power


def lost_and_back(room: MachineRoom) -> Figures:
    """Pull its adapter out in a trial, switch its power in another: both redone."""
    write_make(room, MAKES[0])
    set_up_both(room.shell)
    arm = room.serve_pushed_arm("--line", str(line_port()))
    monitor = Monitor(room)
    try:
        session = begin(room, arm, 1)
        session.await_ready()
        session.record()
        monitor.pull_out(ADAPTER, PORT)
        _interrupted(session)
        monitor.put_in(ADAPTER, PORT)
        _again(session)
        session.record()
        _switch_power(arm, session)
        _again(session)
        session.record()
        session.keep()
        # As `ft-stale` ends, which comes back by itself like these two.
        hold_to("ft-stale", "recording", session.ended())
    finally:
        monitor.close()
    verify_kept(room, 1)
    return {"rejected": str(require_rejected(room, 2)), **cycle_figures(room)}


def _switch_power(arm: Program, session: LedSession) -> None:
    arm.press("sensor_off\n")
    _interrupted(session)
    wait(_SWITCHED)
    arm.press("sensor_on\n")


def _interrupted(session: LedSession) -> None:
    session.program.expect("saved as interrupted", PATIENCE)


def _again(session: LedSession) -> None:
    """Record the same trial once more, when the sensor is back."""
    session.program.run_on(_SETTLED)
    session.hand("rest")
    session.lift()
    session.another()
