"""The arm or the console lost in every phase of a session, and what resume makes of it.

Each scenario is one session that is opened again and again: what is lost in a phase is
mended, then it is resumed up to the next phase.
"""

import signal
from collections.abc import Callable
from dataclasses import dataclass

from lab.guest.machine_room import CAN, MachineRoom
from lab.guest.monitor import CARD, Monitor
from lab.guest.network import NET, set_up
from lab.guest.promises import hold_to
from lab.guest.scenarios.bus import Figures, figure
from lab.guest.scenarios.recording import PATIENCE, served_arm
from lab.guest.sessions import (
    LedSession,
    begin,
    cycle_figures,
    require_rejected,
    resume,
    verify_kept,
)

_INTO_TARE = 0.9  # s: it is still since 0.6 s, the mean is being taken
_DOWN = "interface-down"


def _to_tare(session: LedSession) -> None:
    session.tare()
    session.program.run_on(_INTO_TARE)


def _to_recording(session: LedSession) -> None:
    session.await_ready()
    session.record()


def _to_review(session: LedSession) -> None:
    _to_recording(session)
    session.review()


# How to come to each phase of the fault matrix, in the order in which they are visited.
PHASES: dict[str, Callable[[LedSession], None]] = {
    "idle": LedSession.wait_idle,
    "tare": _to_tare,
    "ready": LedSession.await_ready,
    "recording": _to_recording,
    "review": _to_review,
}
_REJECTED = 2  # attempts that were cut: one while it was recorded, one at its review


def link_down_in_every_phase(room: MachineRoom) -> Figures:
    """Take can0 down in each phase and up again; resume goes on, to the end."""
    arm = served_arm(room)
    session = begin(room, arm, 1)
    figures: Figures = {}
    for phase, come_to in PHASES.items():
        come_to(session)
        _take_down(room)
        code = session.program.wait(PATIENCE)
        hold_to(_DOWN, phase, code)
        figures[phase] = str(code)
        _bring_up(room)
        session = resume(room, arm)
    _to_recording(session)
    session.keep()  # the last tare is asked for
    _take_down(room)
    code = session.program.wait(PATIENCE)
    hold_to(_DOWN, "end", code)
    _bring_up(room)
    require_rejected(room, _REJECTED)
    verify_kept(room, 1)
    return {"exit codes": _codes({**figures, "end": str(code)}), **cycle_figures(room)}


def _codes(figures: Figures) -> str:
    return ", ".join(f"{phase} {code}" for phase, code in figures.items())


def _take_down(room: MachineRoom) -> None:
    room.shell.run(f"ip link set {CAN} down")


def _bring_up(room: MachineRoom) -> None:
    set_up(room.shell, CAN)


@dataclass(frozen=True, slots=True)
class Loss:
    """Something that is lost in a trial.

    Attributes:
        fault: its row of the fault matrix.
        cut: takes it away.
        mend: brings it back.
    """

    fault: str
    cut: Callable[[LedSession], None]
    mend: Callable[[], None]


def lost_in_a_trial(room: MachineRoom) -> Figures:
    """Kill -9 the console in a trial, then pull the CAN card out; resume goes on."""
    monitor = Monitor(room)
    node = NET / CAN

    def put_in() -> None:
        monitor.put_in(CARD, node)
        _bring_up(room)

    losses = (
        Loss("console killed", _kill, lambda: None),
        Loss(_DOWN, lambda _: monitor.pull_out(CARD, node), put_in),
    )
    try:
        return _lose(room, losses)
    finally:
        monitor.close()


def _kill(session: LedSession) -> None:
    session.program.signal(signal.SIGKILL)
    session.program.run_on(1.0)  # the process that outlives it idles the arm


def _lose(room: MachineRoom, losses: tuple[Loss, ...]) -> Figures:
    arm = served_arm(room)
    session = begin(room, arm, 1)
    output = ""
    for loss in losses:
        _to_recording(session)
        loss.cut(session)
        code = session.program.wait(PATIENCE)
        hold_to(loss.fault, "recording", code)
        output += session.program.output
        loss.mend()
        session = resume(room, arm)
    session.whole_trial()
    verify_kept(room, 1)
    put_away = require_rejected(room, len(losses))
    message = figure(output, r"(?m)^((?!.*floating).*ARM: .*)$")
    return {"said": message, "rejected": str(put_away), **cycle_figures(room)}
