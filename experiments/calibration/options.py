"""Options of commands that guide an operator at an arm; imports nothing slow."""

from __future__ import annotations

from typing import TYPE_CHECKING

from experiments.arguments import (
    add_simulation_options,
    add_time_options,
    friction_share,
    requested_time_mode,
)
from experiments.rig.deviation_options import add_truth, mount_of

if TYPE_CHECKING:
    import argparse

    from experiments.rig.rig import FakeOptions


def add_arm(parser: argparse.ArgumentParser) -> None:
    """Declare the options of arm and operator."""
    parser.add_argument("--fake", action="store_true", help="simulated devices")
    add_time_options(parser)
    add_simulation_options(parser)
    add_truth(parser)
    parser.add_argument(
        "--operator-script", metavar="auto", help="simulated operator, only with --fake"
    )


def fake_options(
    args: argparse.Namespace, *, spread: bool = False
) -> FakeOptions | None:
    """Return the options of the simulation; None = the rig is real.

    Args:
        args: options of `add_arm`.
        spread: draw the rig from the population of sound ones, by the seed.

    Raises:
        SettingsError: the friction is not one that can be simulated.
    """
    from experiments.rig.rig import FakeOptions

    if not args.fake:
        return None
    return FakeOptions(
        requested_time_mode(args) or "paced",
        args.seed,
        friction_share(args),
        cables=args.cables,
        spread=spread,
        mount=mount_of(args),
        wrong=args.wrong,
    )
