"""The sensor's adapter and the CAN card unplugged in a trial and plugged in again."""

from lab.guest.machine_room import CAN, MachineRoom, line_port
from lab.guest.monitor import ADAPTER, CARD, Monitor
from lab.guest.network import NET, set_up, set_up_both
from lab.guest.promises import require_promised
from lab.guest.scenarios.bus import Figures, figure
from lab.guest.scenarios.serial_line import MAKES, PORT, write_make
from lab.guest.sessions import (
    LedSession,
    begin,
    require_rejected,
    resume,
)

_PATIENCE = 60.0  # s of guest time until an interrupted trial is written
_UNFINISHED = 5  # exit code of a session that can be resumed
_RECONNECT = 2.0  # s until a sensor plugged in again is read


def in_a_trial(room: MachineRoom) -> Figures:
    """Unplug the sensor's adapter in a trial, the CAN card in its repetition.

    After both are plugged in again, the session's preflight finds arm and sensor.
    """
    write_make(room, MAKES[0])
    set_up_both(room.shell)
    arm = room.serve_pushed_arm("--line", str(line_port()))
    monitor = Monitor(room)
    try:
        session = begin(room, arm, 1)
        session.await_ready()
        session.record()
        monitor.unplug(ADAPTER, PORT)
        session.program.expect("saved as interrupted", _PATIENCE)
        monitor.plug_in(ADAPTER, PORT)
        _again(session)
        session.record()
        monitor.unplug(CARD, NET / CAN)
        code = session.cut_off()
        require_promised("interface-down", "recording", code)
        message = figure(session.program.output, r"(?m)^((?!.*floating).*ARM: .*)$")
        monitor.plug_in(CARD, NET / CAN)
        set_up(room.shell, CAN)
        resumed = resume(room, arm)
        resumed.wait_idle()
        resumed.leave()
        room.finish(resumed.program, _PATIENCE, _UNFINISHED)
    finally:
        monitor.close()
    require_rejected(room, 2)
    page = resumed.program.output
    return {
        "exit code": str(code),
        "said": message,
        "again": figure(page, r"loop 0.5 s +(.*)"),
        "samples": figure(page, r"F/T samples +(.*)"),
    }


def _again(session: LedSession) -> None:
    """Wait until the trial can be recorded again with the reconnected sensor."""
    session.program.run_on(_RECONNECT)
    session.hand("rest")
    session.lift()
    session.another()
