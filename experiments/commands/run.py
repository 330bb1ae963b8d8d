"""traction run: record a session of trials on one terrain."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from experiments.console import Console
    from experiments.preflight import Preflight
    from experiments.rigs import Rig
    from experiments.trial import SessionFacts

EXAMPLES = """\
  traction run S0 --fake --fast             a simulated session, ten trials
  traction run S10 --operator mk            a session with the real arm"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `run`."""
    parser.add_argument("terrain", metavar="TERRAIN", help="a name in matrix.toml")
    parser.add_argument("--fake", action="store_true", help="simulated devices")
    parser.add_argument(
        "--fast", action="store_true", help="stepped time, only with --fake"
    )
    parser.add_argument("--trials", type=int, metavar="N", help="how many to keep")
    parser.add_argument("--operator", default="", metavar="NAME", help="who pushes")
    parser.add_argument(
        "--seed", type=int, default=1, metavar="N", help="of the simulation (1)"
    )
    parser.add_argument(
        "--friction",
        type=float,
        default=0.05,
        metavar="SHARE",
        help="of the simulated joints: 1 = as identified on another arm (0.05)",
    )
    parser.add_argument(
        "--pace",
        choices=("steady", "slow", "fast", "clumsy"),
        default="steady",
        help="how the simulated person pushes (steady)",
    )
    parser.add_argument(
        "--fault", metavar="NAME[@Tn+SECONDSs]", help="raise a fault, with --fake"
    )
    parser.add_argument(
        "--operator-script",
        metavar="FILE|auto",
        help="answers to the reviews, one per line: keep, redo 1..5, quit",
    )
    parser.add_argument(
        "--can-log", type=Path, metavar="FILE", help="write every CAN frame there"
    )


def run(args: argparse.Namespace) -> int:
    """Run one session and return the exit code."""
    from experiments.bus_log import logging_bus
    from experiments.company import Company, StopFlag, signals_ask
    from experiments.console import Console
    from experiments.faults import plan_fault
    from experiments.operator import RehearsedHand, choose_keys
    from experiments.preflight import connect_rig, run_preflight
    from experiments.rigs import FakeOptions
    from experiments.runner import SessionRunner
    from experiments.settings import load_settings
    from experiments.stage import Stage
    from experiments.terminal import keyboard
    from experiments.wreckage import find_wreckage, held_open

    _check_arguments(args)
    settings = load_settings(args.config)
    row = settings.row(args.terrain)
    console = Console(color=not args.no_color)
    keys = choose_keys(args.operator_script, is_fake=args.fake)
    fake: FakeOptions | None = None
    if args.fake:
        fake = FakeOptions(args.fast, args.seed, args.friction, args.pace)
    rig = connect_rig(settings, row, fake)
    stop = StopFlag()
    with logging_bus(rig, args.can_log, console):
        fault = plan_fault(args.fault, rig.rehearsal) if args.fault else None
        kind = "SIMULATED" if rig.is_simulated else "LIVE RIG"
        console.say(f"traction run {row.name}        {kind}")
        for wreck in find_wreckage(Path(args.data)):
            console.say(f"▲ {wreck.text()}")
        page = run_preflight(rig, Path(args.data), console)
        with signals_ask(stop), keyboard(keys):
            facts = _open_session(args, rig, page, console)
            hand = RehearsedHand(rig.rehearsal) if rig.rehearsal else None
            company = Company(keys, console, stop, hand, fault)
            stage = Stage(rig, company)
            with held_open(facts.folder):
                code = SessionRunner(stage, facts).run(args.trials or row.trials)
    if company.fault is not None:
        console.say(
            f"▲ The fault {company.fault.name} was planned for "
            f"T{company.fault.trial:02d} + {company.fault.seconds} s, which never came."
        )
    if code == 0:
        data = f" --data {args.data}" if str(args.data) != "data" else ""
        console.say(f"Complete. Next: traction report {facts.folder.id}{data}")
    return code


def _check_arguments(args: argparse.Namespace) -> None:
    from acquisition.errors import SettingsError

    nothing = "Nothing was started."
    if not args.fake and (args.fast or args.fault or args.operator_script):
        raise SettingsError(
            "--fast, --fault and --operator-script work only with --fake.", hint=nothing
        )
    if args.trials is not None and not 1 <= args.trials <= 99:
        raise SettingsError(
            f"--trials {args.trials} - expected a whole number 1..99, e.g. 10.",
            hint=nothing,
        )
    if not 0.0 <= args.friction <= 2.0:
        raise SettingsError(
            f"--friction {args.friction:g} - expected a number 0..2, e.g. 0.05.",
            hint=nothing,
        )
    if args.seed < 0:
        raise SettingsError(
            f"--seed {args.seed} - expected a whole number >= 0, e.g. 1.", hint=nothing
        )


def _open_session(
    args: argparse.Namespace, rig: Rig, page: Preflight, console: Console
) -> SessionFacts:
    """Create the session's folder and write what is known at its start."""
    from experiments.store import (
        create_session,
        session_utc_ns,
        write_json,
        write_text,
    )
    from experiments.trial import collect_facts

    folder = create_session(
        Path(args.data),
        rig.row.name,
        is_simulated=rig.is_simulated,
        utc_ns=session_utc_ns(),
    )
    console.say(f"session {folder.id}: {folder.path}")
    operator = args.operator or ("auto" if rig.is_simulated else "")
    seed = args.seed if rig.is_simulated else None
    facts = collect_facts(folder, operator, seed, page.devices)
    write_json(folder.path / "preflight.json", page.as_dict())
    write_json(folder.path / "provenance.json", facts.provenance)
    write_text(folder.path / "config.toml", rig.settings.rig_text)
    write_text(folder.path / "matrix.toml", rig.settings.matrix_text)
    write_text(folder.path / "diff.patch", facts.diff)
    return facts
