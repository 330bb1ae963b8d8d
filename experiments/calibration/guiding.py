"""A person guided at the arm: the rig opened and checked, the arm left idle."""

import argparse
from collections.abc import Callable, Collection
from pathlib import Path

from acquisition.control_loop.faults import Action
from acquisition.errors import SettingsError, TractionError
from experiments.calibration.options import fake_options
from experiments.messages import FaultContext, fault_text, rest_text
from experiments.operator.console import Console
from experiments.operator.scripted import choose_operator
from experiments.operator.terminal import keyboard
from experiments.preflight.connecting import connect_rig
from experiments.preflight.preflight import run_preflight
from experiments.rig.bus_log import logging_bus
from experiments.rig.simulation import SimulatedHand
from experiments.run.console_loop import TICK, ConsoleLoop
from experiments.run.pose_walk import MoveStoppedError
from experiments.run.stop import (
    INTERRUPTED,
    ArmFaultError,
    StopFlag,
    StopRequestedError,
    handle_signals,
)
from experiments.settings.load import Settings
from experiments.settings.matrix import TerrainRow

_NOTHING = "Nothing was written."
_STOPPED = "The move was stopped; it goes on when it is asked for anew only."
_HOLD = 0.2  # s between a stop and idle


def check_new(out: Path) -> None:
    """Refuse before the arm moves what could not be written afterwards.

    Raises:
        SettingsError: there is such a file, or no folder for it.
    """
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
    made_anew: Collection[str],
) -> int:
    """Open the rig, check it, do the work; return the exit code.

    Args:
        args: as `add_arm` declares them.
        settings: all settings.
        row: the terrain.
        work: what a person is guided through.
        command: to start it again.
        made_anew: of what a commissioning stands on, what is measured anew.

    Raises:
        TractionError: the rig cannot be opened or is not fit.
    """
    fake = fake_options(args)
    console = Console(color=not args.no_color, goes_on=True)
    operator = choose_operator(args.operator_script, is_fake=args.fake)
    rig = connect_rig(settings, row, fake)
    kind = "SIMULATED" if rig.is_simulated else "LIVE RIG"
    console.say(f"{command}        {kind} · foot {row.foot}")
    stop = StopFlag()
    with logging_bus(rig, None, console), handle_signals(stop), keyboard(operator):
        run_preflight(rig, Path(args.data), console, made_anew=made_anew)
        hand = SimulatedHand(rig.simulation) if rig.simulation else None
        console_loop = ConsoleLoop(rig, console, operator, stop, hand)
        return _guided(console_loop, lambda: work(console_loop), command)


def _guided(console_loop: ConsoleLoop, work: Callable[[], None], command: str) -> int:
    """Do `work` and return the exit code; an error is shown on the console.

    Every way out leaves the arm idle: after a stop it holds first, or damps when the
    stop was asked for twice; an arm that is driven is supported first. The message of a
    fault names `command` to start again.
    """
    console = console_loop.console
    try:
        work()
    except StopRequestedError:
        console_loop.stop_arm()
        console_loop.loop_client.advance(_HOLD)
        console.say(f"Stopped as asked. {_NOTHING}")
        return INTERRUPTED
    except ArmFaultError as fault:
        was_moving = isinstance(fault, MoveStoppedError)
        if was_moving and fault.verdict.action is Action.DAMP:
            # No hand is on it: what it is too fast by may be its own encoder.
            console_loop.make_safe()
        loop_client = console_loop.loop_client
        loop_client.advance(TICK)
        context = FaultContext(
            "The calibration",
            bus=loop_client.loop.bus_condition,
            prompt=None,
            command=command,
            state=loop_client.status.state,
        )
        result = f"{_STOPPED} {_NOTHING}" if was_moving else _NOTHING
        console.problem(fault_text(fault.verdict, context, result))
        return 4
    except TractionError as error:
        console.problem(f"{error} {_NOTHING}")
        return error.exit_code
    finally:
        console_loop.lay_down()
        confirmed = console_loop.make_safe()
        mode = console_loop.rig.backend.safety_mode()
        console.say(rest_text(mode, is_confirmed=confirmed))
    return 0
