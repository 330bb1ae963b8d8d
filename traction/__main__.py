# PYTHON_ARGCOMPLETE_OK
"""Entry point of the command line; checks first that no package is shadowed."""

import os
import sys
from collections.abc import Sequence

from traction.installation import check_packages

_USAGE = 2  # exit code


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code."""
    open_standard_streams()
    try:
        check_packages()
    except ImportError as error:
        print(error, file=sys.stderr)  # noqa: T201
        return _USAGE
    from experiments import __main__ as commands

    return commands.main(arguments)


def open_standard_streams() -> None:
    """Open closed standard streams on the null device.

    Services and cron may start programs with these closed. The next files opened would
    take their descriptors 0 to 2, and child processes would lose them.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest free descriptor
            os.set_inheritable(number, True)
        if getattr(sys, name) is None:
            mode = "r" if name == "stdin" else "w"
            setattr(sys, name, open(number, mode, closefd=False))  # noqa: SIM115


if __name__ == "__main__":
    sys.exit(main())
