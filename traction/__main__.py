# PYTHON_ARGCOMPLETE_OK
"""The command line, once it is certain that the program's own packages are loaded."""

import sys
from collections.abc import Sequence

from traction.installation import check_packages

_USAGE = 2  # exit code


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code."""
    try:
        check_packages()
    except ImportError as error:
        print(error, file=sys.stderr)  # noqa: T201
        return _USAGE
    from experiments import __main__ as commands

    return commands.main(arguments)


if __name__ == "__main__":
    sys.exit(main())
