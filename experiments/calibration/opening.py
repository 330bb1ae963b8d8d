"""What every guided calibration does before and after its own work."""

from __future__ import annotations

from typing import TYPE_CHECKING

from experiments.arguments import (
    add_simulated_arm,
    add_time,
    asked_time,
    friction_share,
)
from experiments.rig.truth_options import add_truth, check_truth, mount_of

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable, Collection
    from pathlib import Path

    from experiments.run.console_loop import ConsoleLoop
    from experiments.settings.load import Settings
    from experiments.settings.matrix import TerrainRow


def add_arm(parser: argparse.ArgumentParser) -> None:
    """Declare which arm is guided, and by whom."""
    parser.add_argument("--fake", action="store_true", help="simulated devices")
    add_time(parser)
    add_simulated_arm(parser)
    add_truth(parser)
    parser.add_argument(
        "--operator-script", metavar="auto", help="simulated operator, only with --fake"
    )


def check_arm(args: argparse.Namespace) -> None:
    """Refuse options of a simulated arm on a real one.

    Raises:
        SettingsError: one of them was given.
    """
    from acquisition.errors import SettingsError

    if not args.fake and (asked_time(args) or args.operator_script):
        raise SettingsError(
            "--fast, --processes and --operator-script work only with --fake.",
            hint="Nothing was started.",
        )
    check_truth(args)


def check_new(out: Path) -> None:
    """Refuse before the arm moves what could not be written afterwards.

    Raises:
        SettingsError: there is such a file, or no folder for it.
    """
    from acquisition.errors import SettingsError

    if out.exists():
        raise SettingsError(
            f"{out} exists and is never overwritten.",
            hint="Move it away or choose another name with --to. Nothing was started.",
        )
    if not out.parent.is_dir():
        raise SettingsError(
            f"There is no folder {out.parent} for the calibration.",
            hint="Make it, or choose another name with --to. Nothing was started.",
        )


def guide_person(
    args: argparse.Namespace,
    settings: Settings,
    row: TerrainRow,
    work: Callable[[ConsoleLoop], None],
    command: str,
    made_anew: Collection[str] | None = None,
) -> int:
    """Open the rig, check it, do the work; return the exit code.

    Args:
        args: as `add_arm` declares them.
        settings: all settings.
        row: the terrain.
        work: what a person is guided through.
        command: to start it again.
        made_anew: of what a commissioning stands on, what is measured anew; None = no
            torque follows.

    Raises:
        TractionError: the rig cannot be opened or is not fit.
    """
    from pathlib import Path

    from experiments.operator.console import Console
    from experiments.operator.scripted import choose_operator
    from experiments.operator.terminal import keyboard
    from experiments.preflight.connecting import connect_rig
    from experiments.preflight.preflight import run_preflight
    from experiments.rig.bus_log import logging_bus
    from experiments.rig.rig import FakeOptions
    from experiments.rig.simulation import SimulatedHand
    from experiments.run.console_loop import ConsoleLoop
    from experiments.run.pose_walk import guided
    from experiments.run.stop import StopFlag, handle_signals

    friction = friction_share(args)
    console = Console(color=not args.no_color, goes_on=True)
    operator = choose_operator(args.operator_script, is_fake=args.fake)
    fake: FakeOptions | None = None
    if args.fake:
        fake = FakeOptions(
            asked_time(args) or "paced",
            args.seed,
            friction,
            cables=args.cables,
            mount=mount_of(args),
            wrong=args.wrong,
        )
    rig = connect_rig(settings, row, fake)
    kind = "SIMULATED" if rig.is_simulated else "LIVE RIG"
    console.say(f"{command}        {kind} · foot {row.foot}")
    stop = StopFlag()
    with logging_bus(rig, None, console), handle_signals(stop), keyboard(operator):
        run_preflight(rig, Path(args.data), console, made_anew=made_anew)
        hand = SimulatedHand(rig.simulation) if rig.simulation else None
        console_loop = ConsoleLoop(rig, console, operator, stop, hand)
        return guided(console_loop, lambda: work(console_loop), command)
