"""Options on true deviations of a simulated rig; imports nothing slow."""

from __future__ import annotations

import sys
from argparse import Action, ArgumentError, ArgumentParser, Namespace
from collections.abc import Sequence
from typing import TYPE_CHECKING

from experiments.arguments import did_you_mean, number_within

if TYPE_CHECKING:
    from experiments.rig.fake import TrueDeviations

_HELP = "help"
_DEGREES = number_within(-180.0, 180.0, "degrees -180..180, e.g. 90")


class WrongRigChoice(Action):
    """Accepts the name of a faulty rig; `help` or an unknown name lists them.

    The catalogue is read only if the option is given.
    """

    def __call__(
        self,
        parser: ArgumentParser,
        namespace: Namespace,
        values: str | Sequence[object] | None,
        option_string: str | None = None,
    ) -> None:
        """Store the name.

        Raises:
            ArgumentError: there is no such rig.
        """
        from experiments.rig.fake import wrong_rigs

        del option_string
        name, rigs = str(values), wrong_rigs()
        width = max(map(len, rigs))
        lines = "\n".join(f"  {rig:{width}}  {rigs[rig]}" for rig in rigs)
        if name == _HELP:
            sys.stdout.write(f"{lines}\n")
            parser.exit()
        if name not in rigs:
            asked = did_you_mean(name, rigs)
            words = f"there is no wrong rig {name[:60]!r}. {asked} They are:\n{lines}"
            raise ArgumentError(self, words)
        setattr(namespace, self.dest, name)


def add_truth(parser: ArgumentParser) -> None:
    """Declare the options on true deviations of the simulated rig."""
    parser.add_argument(
        "--mount",
        nargs=3,
        type=_DEGREES,
        metavar=("X", "Y", "Z"),
        help="rotate the base by degrees about x, then y, then z, without changing "
        "the settings (simulation only)",
    )
    parser.add_argument(
        "--wrong",
        action=WrongRigChoice,
        default="",
        metavar="NAME",
        help="simulate a faulty rig (simulation only); help lists the faults",
    )


def mount_of(args: Namespace) -> tuple[float, float, float] | None:
    """Return the rotations of the base [degrees]; None = as in the settings."""
    if args.mount is None:
        return None
    x, y, z = args.mount
    return x, y, z


def truth_of(args: Namespace, seed: int | None) -> TrueDeviations | None:
    """Return the true deviations of a served arm; None = none.

    With a seed or a defect the arm is drawn from the population of sound ones.
    """
    from experiments.rig.fake import TrueDeviations

    mount = mount_of(args)
    is_drawn = seed is not None or bool(args.wrong)
    if not is_drawn and mount is None:
        return None
    return TrueDeviations(is_drawn, mount or (0.0, 0.0, 0.0), args.wrong)
