"""traction setup: print or install the system files of the host computer."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from experiments.preflight.host_setup import HostSetup
    from experiments.settings.load import Settings

EXAMPLES = """\
  traction setup --config lab/rig.toml             what would be written and run
  traction setup --install --config lab/rig.toml   by root: written and run"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `setup`."""
    what = parser.add_mutually_exclusive_group()
    what.add_argument(
        "--print",
        dest="is_printed",
        action="store_true",
        help="print files and commands, change nothing (the default)",
    )
    what.add_argument(
        "--install", action="store_true", help="write the files and run the commands"
    )
    parser.add_argument(
        "--user",
        metavar="NAME",
        help="user who runs sessions (who called sudo, or you)",
    )
    parser.add_argument(
        "--sensor-serial",
        metavar="TEXT",
        help="serial number of the sensor's adapter, if it is not plugged in",
    )
    parser.add_argument(
        "--root",
        type=Path,
        metavar="DIR",
        help="install into the system image in this folder; no command is run",
    )


def run(args: argparse.Namespace) -> int:
    """Print or install the system files; returns the exit code."""
    from acquisition.errors import SettingsError
    from experiments.operator.console import GOOD, WARNING, Console
    from experiments.preflight.host_setup import SENSOR_LINK, install, run_all
    from experiments.settings.load import load_settings

    if args.root is not None and not args.install:
        raise SettingsError("--root goes with --install.", hint="Add it.")
    if args.root is not None and not args.root.is_dir():
        raise SettingsError(
            f"{args.root} is no folder.", hint="Name the image's. Nothing was written."
        )
    console = Console(color=not args.no_color)
    settings = load_settings(args.config)
    setup = _setup_of(args, settings)
    port = _port_of(settings)
    if setup.serial is None and port is not None:
        console.check(
            WARNING,
            "sensor",
            f"no adapter at {port}: no rule for it; plug it in, or name it by "
            "--sensor-serial",
        )
    if not args.install:
        for file in setup.files():
            console.say(f"# ---- {file.path}")
            console.say(file.text)
        console.say("# ---- then, as root")
        for command in setup.commands():
            console.say(" ".join(command))
        return 0
    changed = install(setup, args.root or Path("/"))
    for path in changed:
        console.check(GOOD, "wrote", str(path))
    if not changed:
        console.check(GOOD, "files", "are there as they should be")
    if args.root is not None:
        return 0
    failed = run_all(setup.commands())
    for text in failed:
        console.check(WARNING, "failed", text)
    if setup.serial is not None:
        console.say(f'Name the sensor in rig.toml: port = "/dev/{SENSOR_LINK}"')
    console.say("Log out and in again: groups and limits are read then.")
    return 2 if failed else 0


def _port_of(settings: Settings) -> str | None:
    """Return the serial port of the sensor, or None."""
    return getattr(settings.rig.ft_sensor, "port", None)


def _setup_of(args: argparse.Namespace, settings: Settings) -> HostSetup:
    """Return the setup of this computer for the rig of the settings."""
    import getpass
    import os

    from experiments.preflight.host_setup import HostSetup
    from ft_sensor.serial_line.link import adapter_serial

    can, port = settings.rig.can, _port_of(settings)
    serial = args.sensor_serial
    if serial is None and port is not None:
        serial = adapter_serial(port)
    user = args.user or os.environ.get("SUDO_USER") or getpass.getuser()
    channel = can.channel if can.interface == "socketcan" else None
    return HostSetup(user, channel, can.bitrate, serial)
