"""traction commission: guided commissioning of an arm, step by step."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from experiments.arguments import friction_share, refuse_simulated_options
from experiments.calibration.options import add_arm, fake_options

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from experiments.commissioning.evidence.order import StepId
    from experiments.commissioning.guide import RecordFolder
    from experiments.commissioning.scene import Scene
    from experiments.commissioning.step import Step
    from experiments.operator.console import Console
    from experiments.operator.prompts import OperatorInput
    from experiments.rig.rig import FakeOptions
    from experiments.settings.load import Settings
    from experiments.settings.matrix import TerrainRow

EXAMPLES = """\
  traction commission --config lab/rig.toml the missing and stale steps in turn
  traction commission --fake --fast --until C3    the first steps, simulated devices"""

FAKE_FOLDER = "commissioning.fake"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `commission`."""
    parser.add_argument(
        "--from",
        dest="first",
        metavar="STEP",
        help="repeat this step and all later ones, e.g. C8",
    )
    parser.add_argument(
        "--until", dest="last", metavar="STEP", help="end after this step, e.g. C4"
    )
    parser.add_argument(
        "--terrain",
        metavar="NAME",
        help="terrain whose container C13 checks (the first of matrix.toml)",
    )
    parser.add_argument(
        "--daily",
        action="store_true",
        help="check in two minutes that the arm is still as it was commissioned",
    )
    parser.add_argument(
        "--recheck",
        action="store_true",
        help="evaluate the recordings again, without the arm",
    )
    parser.add_argument(
        "--moved",
        action="store_true",
        help="the arm or its table was moved or bolted again: all steps are stale",
    )
    parser.add_argument(
        "--tensioned",
        action="store_true",
        help="a drive cable was tensioned or replaced: C5 to C11 are stale",
    )
    parser.add_argument(
        "--operator", metavar="NAME", help="name of the operator (default: your login)"
    )
    add_arm(parser)


def run(args: argparse.Namespace) -> int:
    """Run the due steps; returns the exit code."""
    from experiments.commissioning.guide import RecordFolder, recheck
    from experiments.operator.console import Console
    from experiments.operator.scripted import choose_operator
    from experiments.settings.load import load_settings

    refuse_simulated_options(args)
    steps = _steps(args)
    friction_share(args)
    settings = load_settings(args.config)
    console = Console(color=not args.no_color)
    folder = _folder(settings, is_fake=args.fake)
    files = RecordFolder.open(folder, is_simulated=args.fake)
    if args.recheck:
        return 0 if recheck(files, console) else 6
    operator = choose_operator(args.operator_script, is_fake=args.fake)
    fake = fake_options(args, spread=True)
    who = args.operator or operator.who
    kind = "SIMULATED" if args.fake else "LIVE RIG"
    console.say(f"traction commission        {kind} · {files.folder}")
    if args.fake:
        console.say("Simulated hands and pendant do what is asked, at [space].")
    if args.daily:
        return _daily(args, settings, fake, files, who, console, operator)
    _note_changes(args, files)
    code = _run_steps(args, settings, fake, steps, files, who, console, operator)
    if code == 0:
        _print_remaining(files, settings.row(_terrain(args, settings)).name, console)
    return code


def _terrain(args: argparse.Namespace, settings: Settings) -> str:
    """Return the terrain whose container C13 checks."""
    return args.terrain or settings.matrix.terrains[0].name


def _print_remaining(files: RecordFolder, terrain: str, console: Console) -> None:
    """Print the remaining steps, or that the arm is commissioned."""
    from experiments.commissioning.evidence.gate import lacks
    from experiments.commissioning.evidence.record import NAME
    from experiments.commissioning.procedure import STEPS

    last = max(done.ended for done in files.record.steps)
    lacking = {lack.step for lack in lacks(files.record, {}, last, terrain)}
    missing = [step for step in STEPS if step in lacking]
    if missing:
        console.say(f"Still to do: {', '.join(missing)}.")
    else:
        console.say(f"Every step is sound: {files.folder / NAME}.")


def _note_changes(args: argparse.Namespace, files: RecordFolder) -> None:
    """Record the changes reported by options; an empty record has nothing stale."""
    from datetime import UTC, datetime

    from acquisition.clock import SystemClock
    from experiments.commissioning.evidence.order import REPORTED_INPUTS

    if not files.record.steps:
        return
    now = datetime.fromtimestamp(SystemClock().utc_ns() // 1_000_000_000, UTC)
    for name, is_reported in zip(
        REPORTED_INPUTS, (args.moved, args.tensioned), strict=True
    ):
        if is_reported:
            files.report_change(name, now)


def _run_steps(
    args: argparse.Namespace,
    settings: Settings,
    fake: FakeOptions | None,
    steps: Sequence[StepId],
    files: RecordFolder,
    who: str,
    console: Console,
    operator: OperatorInput,
) -> int:
    """Run the steps, as many per connection as possible; returns the exit code."""
    from experiments.commissioning.guide import do_step, wanted
    from experiments.commissioning.procedure import CONNECTIONS
    from experiments.run.stop import StopRequestedError

    row = settings.row(_terrain(args, settings)).as_container()
    is_anew = args.first is not None
    for sitting in CONNECTIONS:
        due = [step for step in sitting if step.id in steps]

        def work(scene: Scene, due: Sequence[Step] = due) -> int:
            for step in wanted(scene, due, files, is_anew=is_anew):
                if do_step(scene, step, files, who).cause:
                    return 3
                if scene.console_loop.stop.count:
                    raise StopRequestedError
            return 0

        if due and (code := _on_rig(settings, row, fake, console, operator, work)):
            return code
    return 0


def _daily(
    args: argparse.Namespace,
    settings: Settings,
    fake: FakeOptions | None,
    files: RecordFolder,
    who: str,
    console: Console,
    operator: OperatorInput,
) -> int:
    """Run the daily check; returns the exit code."""
    from experiments.commissioning.daily import do_daily, reference_of

    reference_of(files)  # raises before the rig is touched
    row = settings.row(_terrain(args, settings)).as_container()

    def work(scene: Scene) -> int:
        check = do_daily(scene, files, who, is_simulated=args.fake)
        return 3 if check.cause else 0

    return _on_rig(settings, row, fake, console, operator, work)


def _on_rig(
    settings: Settings,
    row: TerrainRow,
    fake: FakeOptions | None,
    console: Console,
    operator: OperatorInput,
    work: Callable[[Scene], int],
) -> int:
    """Run `work` on one connection; returns its exit code, or that of an abort."""
    from experiments.commissioning.scene import Scene
    from experiments.messages import rest_text
    from experiments.operator.terminal import keyboard
    from experiments.preflight.connecting import connect_rig
    from experiments.rig.bus_log import logging_bus
    from experiments.run.console_loop import ConsoleLoop
    from experiments.run.stop import (
        INTERRUPTED,
        ArmFaultError,
        StopFlag,
        StopRequestedError,
        handle_signals,
    )

    stop = StopFlag()
    rig = connect_rig(settings, row, fake)
    with logging_bus(rig, None, console), handle_signals(stop), keyboard(operator):
        console_loop = ConsoleLoop(rig, console, operator, stop)
        scene, was_carrying = Scene(rig, console_loop), False
        try:
            return work(scene)
        except StopRequestedError:
            was_carrying = console_loop.is_carrying
            console.say(
                "Stopped as asked. The steps that were done are kept; "
                "traction commission goes on with the next."
            )
            console_loop.stop_arm()
            console_loop.lay_down()
            return INTERRUPTED
        except ArmFaultError as fault:
            was_carrying = console_loop.is_carrying
            console.problem(scene.fault_words(fault))
            return 4
        finally:
            is_confirmed = console_loop.make_safe()
            if was_carrying:
                mode = rig.backend.safety_mode()
                console.say(rest_text(mode, is_confirmed=is_confirmed))


def _steps(args: argparse.Namespace) -> list[StepId]:
    from acquisition.errors import SettingsError
    from experiments.commissioning.procedure import STEPS

    known = list(STEPS)
    ends = [args.first or known[0], args.last or known[-1]]
    for name in ends:
        if name not in known:
            raise SettingsError(
                f"There is no step {name!r}.",
                hint=f"Steps: {' '.join(known)}. Nothing was started.",
            )
    first, last = (known.index(name) for name in ends)
    return known[first : last + 1]


def _folder(settings: Settings, *, is_fake: bool) -> Path:
    folder = settings.folder / FAKE_FOLDER if is_fake else settings.folder
    if is_fake:
        folder.mkdir(exist_ok=True)
    return folder
