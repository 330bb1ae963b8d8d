"""The program as on a system without the functions that Windows lacks.

python -m tests.without_linux ARGUMENTS OF TRACTION ...
"""

import importlib
import os
import sys

ABSENT = (
    "memfd_create",
    "MFD_CLOEXEC",
    "SCHED_FIFO",
    "sched_getaffinity",
    "sched_param",
    "sched_setaffinity",
    "sched_setscheduler",
)


def remove() -> None:
    """Remove the functions that are absent elsewhere; call before any import."""
    importlib.import_module("serial")  # which has a port of its own for each system
    for name in ABSENT:
        if hasattr(os, name):
            delattr(os, name)
    sys.modules["fcntl"] = None  # type: ignore[assignment]


if __name__ == "__main__":
    remove()
    sys.exit(importlib.import_module("experiments.__main__").main(sys.argv[1:]))
