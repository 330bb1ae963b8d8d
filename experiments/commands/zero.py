"""traction zero: tell the motor controllers that the arm stands at home."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from experiments.operator.console import Console
    from experiments.rig.rig import Rig
    from wam.driver.startup import ArmInfo

EXAMPLES = """\
  traction zero                             asks, then defines the home position
  traction zero --fake --yes                the same steps with simulated devices"""

_CONFIRMATION = "home"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `zero`."""
    parser.add_argument("--fake", action="store_true", help="simulated devices")
    parser.add_argument(
        "--yes", action="store_true", help="the arm is at home: do not ask"
    )


def run(args: argparse.Namespace) -> int:
    """Define the home position after confirmation and return the exit code."""
    from experiments.operator.console import GOOD, WARNING, Console
    from experiments.preflight.connecting import connect_rig
    from experiments.rig.requests import DefinePosition
    from experiments.rig.rig import FakeOptions
    from experiments.settings.load import load_settings

    console = Console(color=not args.no_color, goes_on=True)
    settings = load_settings(args.config)
    fake = FakeOptions("fast", seed=1) if args.fake else None
    rig = connect_rig(settings, settings.matrix.terrains[0], fake)
    try:
        info = _start(rig)
        home = rig.model.constants.home
        mode = info.safety_mode.name.lower().replace("_", "-")
        console.check(GOOD, "arm", f"pucks 1-7 answer, safety {mode}")
        for text in info.warnings:
            console.check(WARNING, "start-up", text)
        angles = "  ".join(f"J{i + 1} {angle:.2f}" for i, angle in enumerate(home))
        console.say(f"Home position, rad: {angles}")
        if not args.yes and not _is_confirmed(console):
            console.say("Nothing was changed. ARM: idle; it sinks slowly, support it.")
            return 5
        _check_encoders(rig, _start(rig), console)  # it was moved until now
        rig.backend.ask(DefinePosition(home.tolist()))
        console.check(GOOD, "zero", "positions defined at home")
    finally:
        rig.backend.close()
    return 0


def _start(rig: Rig) -> ArmInfo:
    """Ask the arm who it is; raise PreflightError when it is not fit."""
    from acquisition.errors import PreflightError, TractionError
    from experiments.rig.requests import StartArm

    try:
        return rig.backend.ask(StartArm())
    except TractionError as error:
        state = error.arm_state or "not touched"
        raise PreflightError(error.message, hint=error.hint, arm_state=state) from error


def _check_encoders(rig: Rig, info: ArmInfo, console: Console) -> None:
    """Compare the absolute encoders with those of the last time, or say what to note.

    Raises:
        PreflightError: the arm is not where home was.
    """
    from experiments.operator.console import GOOD, WARNING
    from experiments.preflight.identity import check_identity, serial_numbers
    from wam.driver.home import check_home, home_error

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


def _is_confirmed(console: Console) -> bool:
    """Ask for the word itself: a stray Enter must not move the arm's zero."""
    from acquisition.errors import SettingsError

    if not sys.stdin.isatty():
        raise SettingsError(
            "Zeroing needs a person who confirms, and there is no terminal.",
            hint="Run it in a terminal, or add --yes. Nothing was changed.",
        )
    console.say(
        "Is the arm at home, folded against its stops, and held there? "
        f"Type {_CONFIRMATION} and Enter:"
    )
    return sys.stdin.readline().strip().lower() == _CONFIRMATION
