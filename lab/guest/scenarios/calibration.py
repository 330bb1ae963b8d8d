"""The arm moves by itself, weighed in poses: cut off in a move, then to the end."""

import tomllib

from lab.guest.commands import Program, require
from lab.guest.commissioned import take_as_commissioned
from lab.guest.machine_room import CAN, MachineRoom
from lab.guest.network import set_up
from lab.guest.promises import hold_to
from lab.guest.scenarios.bus import Figures, figure
from lab.guest.scenarios.recording import served_arm
from lab.guest.sessions import LedSession

# Near the upright pose, by which every way goes: each second costs the host many.
_POSES = """\
poses = [
  [0.0, -0.40, 0.0, 1.80, 0.0, -0.40, 0.0],
  [0.1, -0.35, 0.1, 1.75, 0.1, -0.30, 0.0],
  [0.0, -0.45, 0.1, 1.85, 0.0, -0.30, 0.0],
]
"""
_PATIENCE = 60.0  # s of guest time for the whole way
_INTO_MOVE = 0.8  # s


def gravity(room: MachineRoom) -> Figures:
    """Weigh the arm in three poses; at first can0 goes down in a move.

    The poses lie close together, so the fit is forced; that it fits is looked at.
    """
    arm = served_arm(room)
    (room.folder / "poses.toml").write_text(_POSES, encoding="utf-8")
    file = room.folder / "gravity.toml"
    cut = _moving(room, arm)
    cut.program.run_on(_INTO_MOVE)
    room.shell.run(f"ip link set {CAN} down")
    hold_to("interface-down", "moving", cut.program.wait(_PATIENCE))
    require(not file.exists(), "a calibration was written")
    set_up(room.shell, CAN)
    arm.press("mend\n")
    arm.press("idle\n")
    session = _moving(room, arm)
    session.program.expect("Support the arm, it goes idle.", _PATIENCE)
    session.hand("lift")
    session.confirm()
    output = room.finish(session.program, _PATIENCE)
    written = tomllib.loads(file.read_text(encoding="utf-8"))
    require(bool(written), "an empty calibration was written")
    return {"fit": figure(output, r"(rms [\d.]+ N m, rank \d+ of 12)")}


def _moving(room: MachineRoom, arm: Program) -> LedSession:
    """Return a calibration whose arm has begun to move by itself."""
    poses = str(room.folder / "poses.toml")
    words = ("calibrate", "gravity", "--terrain", "TF", "--pose-file", poses, "--force")
    take_as_commissioned(room.config)
    session = LedSession(room, room.traction(*words), arm)
    session.wait_idle()
    session.activate()
    session.program.expect("Let go of it and clear the space", _PATIENCE)
    session.hand("let_go")
    session.confirm()
    return session
