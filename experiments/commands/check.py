"""traction check: check whether the rig is fit, the arm idle without torque."""

from __future__ import annotations

import argparse
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from experiments.arguments import (
    add_time_options,
    did_you_mean,
    number_within,
    refuse_simulated_options,
    requested_time_mode,
)
from experiments.rig.deviation_options import add_truth, mount_of

if TYPE_CHECKING:
    from experiments.operator.console import Console
    from experiments.settings.load import Settings
    from wam.bus.error_frames import BusErrors

EXAMPLES = """\
  traction check --bus 10                   print the bus traffic; nothing is sent
  traction check --fake --json > page.json  the page with simulated devices, as JSON"""

_JSON_SCHEMA = 1


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `check`."""
    parser.add_argument("--fake", action="store_true", help="simulated devices")
    add_time_options(parser)
    parser.add_argument(
        "--loop-test",
        type=number_within(0.1, 3600, "seconds, e.g. 5"),
        metavar="SECONDS",
        help="duration of the loop test (test_time of rig.toml)",
    )
    parser.add_argument(
        "--bus",
        type=number_within(0.1, 3600, "seconds to listen, e.g. 10"),
        metavar="SECONDS",
        help="only listen to the bus: rates, identifiers, errors, other masters",
    )
    parser.add_argument(
        "--terrain", metavar="NAME", help="terrain of matrix.toml (the first)"
    )
    parser.add_argument(
        "--config-only", action="store_true", help="check the settings only"
    )
    parser.add_argument(
        "--explain",
        metavar="NAME|all|states",
        help="explain a message; list all messages; list the states and transitions",
    )
    parser.add_argument(
        "--json", action="store_true", help="print the page, or the refusal, as JSON"
    )
    add_truth(parser)
    parser.add_argument(
        "--can-log", type=Path, metavar="FILE", help="write every CAN frame to FILE"
    )


def run(args: argparse.Namespace) -> int:
    """Print the page and return the exit code."""
    from acquisition.errors import SettingsError
    from experiments.operator.console import GOOD, WARNING, Console
    from experiments.rig.law_calibrations import read_law_calibrations
    from experiments.settings.load import load_settings
    from experiments.settings.origins import origin_lines

    console = Console(color=not args.no_color)
    if args.json and (args.explain or args.config_only or args.bus is not None):
        raise SettingsError(
            "--json is for the page, not for --explain, --config-only or --bus.",
            hint="Leave one of them out.",
        )
    if args.explain:
        return _explain(args.explain, console)
    refuse_simulated_options(args)
    settings = load_settings(args.config)
    if args.config_only:
        read_law_calibrations(settings)
        console.check(GOOD, "config", f"{settings.origin}")
        for text in settings.unusual():
            console.check(WARNING, "settings", text)
        for line in origin_lines(settings):
            console.say(f"   {line}")
        return 0
    if args.bus is not None:
        return _listen(settings, args.bus, console, is_fake=args.fake)
    if args.json:
        return _as_json(args, settings)
    _check(args, settings, console)
    return 0


def _check(args: argparse.Namespace, settings: Settings, console: Console) -> None:
    """Run the preflight and print its page.

    Raises:
        PreflightError: a check failed.
    """
    from experiments.preflight.connecting import connect_rig
    from experiments.preflight.preflight import run_preflight
    from experiments.rig.bus_log import logging_bus
    from experiments.rig.rig import FakeOptions

    first = settings.matrix.terrains[0].name
    row = settings.row(args.terrain or first)
    fake: FakeOptions | None = None
    if args.fake:
        mode = requested_time_mode(args) or "paced"
        fake = FakeOptions(mode, 1, mount=mount_of(args), wrong=args.wrong)
    rig = connect_rig(settings, row, fake)
    console.say("traction check        " + ("SIMULATED" if fake else "LIVE RIG"))
    with logging_bus(rig, args.can_log, console):
        run_preflight(rig, Path(args.data), console, args.loop_test)
    console.say("The rig is ready. No torque was sent.")


def _as_json(args: argparse.Namespace, settings: Settings) -> int:
    """Print the page as JSON, with its error, which is then raised.

    Raises:
        PreflightError: a check failed.
    """
    import json

    from acquisition.errors import TractionError
    from experiments import provenance
    from experiments.operator.console import Console, PageRecorder

    page = PageRecorder()
    refusal: TractionError | None = None
    try:
        _check(args, settings, page)
    except TractionError as error:
        refusal = error
    report = {
        "schema": _JSON_SCHEMA,
        "is_fit": refusal is None,
        "is_simulated": bool(args.fake),
        "checks": page.checks,
        "problem": None if refusal is None else str(refusal),
        "software": provenance.collect(),
    }
    Console(color=False).say(json.dumps(report, indent=1, ensure_ascii=False))
    if refusal is not None:
        raise refusal
    return 0


def _listen(
    settings: Settings, seconds: float, console: Console, *, is_fake: bool
) -> int:
    """Print the traffic of the arm's bus; nothing is sent.

    Raises:
        SettingsError: a simulated bus exists only inside its own process.
        LinkError: the bus cannot be opened, or broke.
    """
    from acquisition.clock import SystemClock
    from acquisition.errors import SettingsError
    from wam.bus.link import CanLink
    from wam.bus.log import BusTraffic
    from wam.bus.transports import open_transport

    if is_fake:
        raise SettingsError(
            "A simulated bus is inside its own process and cannot be listened to.",
            hint="Serve one with traction fake --can traction-fake:PATH and name it in "
            "[can] of rig.toml.",
        )
    can, clock, traffic = settings.rig.can, SystemClock(), BusTraffic()
    console.say(
        f"traction check --bus        {can.interface}:{can.channel} for {seconds:g} s, "
        "nothing is sent"
    )
    transport = open_transport(can.interface, can.channel, can.bitrate, clock)
    link = CanLink(transport, traffic)
    try:
        deadline_ns = clock.now_ns() + round(seconds * 1e9)
        while clock.now_ns() < deadline_ns:
            clock.wait(link, deadline_ns)
            link.receive()
    finally:
        link.close()
    load = traffic.load(seconds, can.bitrate)
    _print_traffic(traffic.counts, seconds, load, console)
    _print_errors(link.foreign_ids, link.errors, console)
    return 0


def _print_traffic(
    counts: Mapping[int, int], seconds: float, load: float, console: Console
) -> None:
    """Print the rate of each identifier."""
    from experiments.operator.console import GOOD
    from wam.bus.decoder import describe_id

    if not counts:
        console.check(GOOD, "traffic", "silent, as an arm is while no host polls it")
        return
    rate = sum(counts.values()) / seconds
    console.check(GOOD, "traffic", f"{rate:.1f} frames/s, about {load:.0%} of the bus")
    for can_id, count in sorted(counts.items()):
        console.say(f"   {can_id:03X} {count / seconds:8.1f}/s  {describe_id(can_id)}")


def _print_errors(
    foreign: Collection[int], errors: BusErrors, console: Console
) -> None:
    """Print other masters and the errors of the controller."""
    from acquisition.devices import BusCondition
    from experiments.messages import BUS_WORDS
    from experiments.operator.console import BAD, GOOD, WARNING

    names = ", ".join(f"{can_id:03X}" for can_id in sorted(foreign))
    console.check(
        WARNING if names else GOOD,
        "masters",
        f"another program drives the arm: {names}" if names else "none",
    )
    is_sound = errors.condition is BusCondition.SOUND
    advice = "" if is_sound else f" {BUS_WORDS[errors.condition]}"
    mark = GOOD if not errors.frames else WARNING if is_sound else BAD
    console.check(mark, "errors", f"{errors.text() or 'none'}.{advice}")


def _explain(name: str, console: Console) -> int:
    from acquisition.control_loop.states import transition_lines
    from acquisition.errors import SettingsError
    from experiments.messages import CATALOGUE, catalogue_table, explanation
    from experiments.session.states import table_lines

    pages = {
        "states": lambda: [*table_lines(), *transition_lines()],
        "all": catalogue_table,
    }
    if name not in pages and name not in CATALOGUE:
        asked = did_you_mean(name, [*pages, *CATALOGUE])
        raise SettingsError(
            f"There is no message called {name!r}. {asked}".rstrip(),
            hint=f"Known: states, all, {', '.join(sorted(CATALOGUE))}.",
        )
    for line in pages[name]() if name in pages else explanation(name):
        console.say(line)
    return 0
