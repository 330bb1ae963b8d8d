"""Guide an operator at the arm: open and check the rig, leave the arm idle."""

import argparse
from collections.abc import Callable, Collection
from pathlib import Path

from acquisition.control_loop.faults import Action, GuardVerdict
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
_STOPPED = "The move was stopped; it does not go on by itself."
_HOLD = 0.2  # s, from a stop to idle


def check_new(out: Path) -> None:
    """Refuse an output file that could not be written, before the arm moves.

    Raises:
        SettingsError: the file exists, or its folder does not.
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
    """Open the rig, check it, do the work; returns the exit code.

    Args:
        args: options of `add_arm`.
        settings: all settings.
        row: the terrain.
        work: the guided work.
        command: command that starts it again.
        made_anew: inputs of the commissioning that are measured again.

    Raises:
        TractionError: the rig cannot be opened or fails the preflight.
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
    """Do `work`; returns the exit code; errors are printed on the console.

    Every exit leaves the arm idle: after a stop it holds first, or damps after a second
    request; a driven arm is supported first. The message of a fault names `command` to
    start again.
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
            # Nobody holds the arm: the excessive speed may be an encoder fault.
            console_loop.make_safe()
        console_loop.loop_client.advance(TICK)
        result = f"{_STOPPED} {_NOTHING}" if was_moving else _NOTHING
        console.problem(_fault_text(console_loop, fault.verdict, command, result))
        return 4
    except TractionError as error:
        console.problem(f"{error} {_NOTHING}")
        verdict = console_loop.standing_verdict()
        if verdict is None:
            return error.exit_code
        console.problem(_fault_text(console_loop, verdict, command, ""))
        return 4
    finally:
        console_loop.lay_down()
        is_confirmed = console_loop.make_safe()
        mode = console_loop.rig.backend.safety_mode()
        console.say(rest_text(mode, is_confirmed=is_confirmed))
    return 0


def _fault_text(
    console_loop: ConsoleLoop, verdict: GuardVerdict, command: str, result: str
) -> str:
    """Return the message of a fault; `command` starts the calibration again."""
    loop_client = console_loop.loop_client
    context = FaultContext(
        "The calibration",
        bus=loop_client.loop.bus_condition,
        prompt=None,
        command=command,
        state=loop_client.status.state,
    )
    return fault_text(verdict, context, result)
