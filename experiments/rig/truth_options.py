"""Options that say what is true of a simulated rig; imports nothing slow."""

from __future__ import annotations

import sys
from argparse import Action, ArgumentError, ArgumentParser, Namespace
from collections.abc import Sequence
from typing import TYPE_CHECKING

from experiments.arguments import did_you_mean, number_within

if TYPE_CHECKING:
    from experiments.rig.fake import RigTruth

_HELP = "help"
_DEGREES = number_within(-180.0, 180.0, "degrees -180..180, e.g. 90")


class WrongRigChoice(Action):
    """Takes the name of a wrong rig; `help`, or a name that there is not, lists them.

    The catalogue is read when the option is given, not before.
    """

    def __call__(
        self,
        parser: ArgumentParser,
        namespace: Namespace,
        values: str | Sequence[object] | None,
        option_string: str | None = None,
    ) -> None:
        """Keep the name.

        Raises:
            ArgumentError: there is no such rig.
        """
        from experiments.rig.fake import wrong_rigs

        del option_string
        name, rigs = str(values), wrong_rigs()
        width = max(map(len, rigs))
        lines = "\n".join(f"  {each:{width}}  {rigs[each]}" for each in rigs)
        if name == _HELP:
            sys.stdout.write(f"{lines}\n")
            parser.exit()
        if name not in rigs:
            asked = did_you_mean(name, rigs)
            words = f"there is no wrong rig {name[:60]!r}. {asked} They are:\n{lines}"
            raise ArgumentError(self, words)
        setattr(namespace, self.dest, name)


def add_truth(parser: ArgumentParser) -> None:
    """Declare what is true of the simulated rig, but not believed."""
    parser.add_argument(
        "--mount",
        nargs=3,
        type=_DEGREES,
        metavar=("X", "Y", "Z"),
        help="the true base is turned by so many degrees about x, then y, then z; the "
        "program does not know, only if simulated",
    )
    parser.add_argument(
        "--wrong",
        action=WrongRigChoice,
        default="",
        metavar="NAME",
        help="a rig with something wrong, only if simulated; help lists them",
    )


def check_truth(args: Namespace) -> None:
    """Refuse what is true of a simulated rig where the rig is real.

    Raises:
        SettingsError: --mount or --wrong without --fake.
    """
    from acquisition.errors import SettingsError

    if (args.wrong or args.mount) and not args.fake:
        raise SettingsError(
            "--mount and --wrong work only with --fake.", hint="Nothing was started."
        )


def mount_of(args: Namespace) -> tuple[float, float, float] | None:
    """Return the turns of the base [degrees]; None = as it is believed."""
    if args.mount is None:
        return None
    x, y, z = args.mount
    return x, y, z


def truth_of(args: Namespace, seed: int | None) -> RigTruth | None:
    """Return what is true of a served arm; None = what is believed.

    It is one of many sound ones where it has a seed, or something wrong.
    """
    from experiments.rig.fake import RigTruth

    mount = mount_of(args)
    is_drawn = seed is not None or bool(args.wrong)
    if not is_drawn and mount is None:
        return None
    return RigTruth(is_drawn, mount or (0.0, 0.0, 0.0), args.wrong)
