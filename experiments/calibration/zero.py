"""traction zero: define the present position of the arm as home.

Nothing moves and nothing is fitted, so it is no `GuidedCalibration`.
"""

from collections.abc import Callable

from acquisition.errors import PreflightError, TractionError
from experiments.operator.console import GOOD, WARNING, Console
from experiments.preflight.identity import check_identity, serial_numbers
from experiments.rig.requests import DefinePosition, StartArm
from experiments.rig.rig import Rig
from wam.driver.home import check_home, home_error
from wam.driver.startup import ArmInfo


def define_home(rig: Rig, console: Console, confirm: Callable[[], bool]) -> bool:
    """Show the home position, have it confirmed, define it; returns whether it was.

    Args:
        rig: the rig, its bus open, its loop not started.
        console: output.
        confirm: asks whether the arm is at home.

    Raises:
        PreflightError: the arm is not fit, or not at its previous home.
    """
    info = _start(rig)
    home = rig.model.constants.home
    mode = info.safety_mode.name.lower().replace("_", "-")
    console.check(GOOD, "arm", f"pucks 1-7 answer, safety {mode}")
    for text in info.warnings:
        console.check(WARNING, "start-up", text)
    angles = "  ".join(f"J{i + 1} {angle:.2f}" for i, angle in enumerate(home))
    console.say(f"Home position, rad: {angles}")
    if not confirm():
        console.say("Nothing was changed. ARM: idle; it sinks slowly, support it.")
        return False
    _check_encoders(
        rig, _start(rig), console
    )  # the arm was moved before the confirmation
    rig.backend.ask(DefinePosition(home.tolist()))
    console.check(GOOD, "zero", "positions defined at home")
    return True


def _start(rig: Rig) -> ArmInfo:
    """Start the arm; raises PreflightError if it is not fit."""
    try:
        return rig.backend.ask(StartArm())
    except TractionError as error:
        state = error.arm_state or "not touched"
        raise PreflightError(error.message, hint=error.hint, arm_state=state) from error


def _check_encoders(rig: Rig, info: ArmInfo, console: Console) -> None:
    """Compare the absolute encoders with the previous home, or print them.

    Raises:
        PreflightError: the arm is not at its previous home.
    """
    rig.serials = serial_numbers(rig, info)
    check_identity(rig, console.check)
    before = rig.settings.rig.arm.mech_at_home
    mech = [puck.mech for puck in info.pucks if puck.mech is not None]
    if len(mech) < len(info.pucks):
        if before is not None:
            console.check(WARNING, "encoders", "not absolute: home is not checked")
        return
    if before is None:
        whose = f", serial_numbers = {[*rig.serials]}" if rig.serials else ""
        console.say(
            "To check the next zeroing, in [arm] of rig.toml: "
            f"mech_at_home = {mech}{whose}"
        )
        return
    cts = [puck.cts for puck in info.pucks]
    error = home_error(rig.model.constants.j2mp, cts, mech, before)
    check_home(error)
    worst = float(abs(error).max())
    console.check(GOOD, "encoders", f"{worst:.4f} rad at most from the last home")
