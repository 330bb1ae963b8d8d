# PYTHON_ARGCOMPLETE_OK
"""The command line, once it is certain that the program's own packages are loaded."""

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
    """Point closed standard streams at nothing, as services and cron start programs.

    Else the next files that are opened take their numbers, and processes that are
    started lose them.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free
            os.set_inheritable(number, True)
        if getattr(sys, name) is None:
            mode = "r" if name == "stdin" else "w"
            setattr(sys, name, open(number, mode, closefd=False))  # noqa: SIM115


if __name__ == "__main__":
    sys.exit(main())
