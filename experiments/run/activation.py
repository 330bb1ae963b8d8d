"""The pendant activates the arm: torques are ready before, a person says when."""

from acquisition import MOTOR_FRESH_SHIFT, SafetyMode
from acquisition.control_loop import ArmState
from experiments.messages import preflight_error, pucks_have
from experiments.operator import Prompt
from experiments.run.console_loop import ConsoleLoop

PATIENCE = 120.0  # how long a person may take to activate the arm [s]
_READY_SECONDS = 0.1  # from the request for hold to its first torques


def activate(console_loop: ConsoleLoop) -> None:
    """Get torques ready, then wait for the pendant and for [space].

    Raises:
        PreflightError: no torques can be made ready, or the arm was not activated
            within two minutes.
        StopRequestedError, ArmFaultError: as `ConsoleLoop.tick`.
    """
    control, clock = console_loop.loop_client, console_loop.rig.clock
    control.request(ArmState.HOLD)
    control.advance(_READY_SECONDS)
    _require_torques(console_loop)
    console_loop.console.say(
        "Press Shift-activate on the pendant, support the arm, then [space]."
    )
    is_ready = False
    start_ns = clock.now_ns()
    while True:
        is_ready = console_loop.tick(Prompt.SUPPORT) == " " or is_ready
        if is_ready and control.status.safety is SafetyMode.ACTIVE:
            return
        if (clock.now_ns() - start_ns) * 1e-9 > PATIENCE:
            raise preflight_error("not-active", seconds=PATIENCE)


def _require_torques(console_loop: ConsoleLoop) -> None:
    """Refuse to ask for the pendant while the arm would be active and fall.

    Hold begins with a complete reading; without one no torque would be there.
    """
    control = console_loop.loop_client
    loop = control.loop
    if loop.control.state is ArmState.HOLD or loop.control.verdict is not None:
        return  # ready, or the next tick tells why not
    if loop.control.safety is SafetyMode.E_STOP:
        raise preflight_error("no-power")
    silent = ~int(control.latest()["flags"][0]) >> MOTOR_FRESH_SHIFT & 0x7F
    detail = f"{pucks_have(silent)} not answered for {_READY_SECONDS * 1e3:.0f} ms."
    if loop.is_bus_down:
        detail = "The CAN interface refuses to send and receive."
    raise preflight_error("not-ready", detail=detail)
