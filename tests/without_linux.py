"""Run Traction without the Linux-only functions of `os`, as on Windows.

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
    """Remove the Linux-only functions; call before Traction is imported."""
    importlib.import_module("serial")  # first: it needs them to choose its backend
    for name in ABSENT:
        if hasattr(os, name):
            delattr(os, name)
    sys.modules["fcntl"] = None  # type: ignore[assignment]


if __name__ == "__main__":
    remove()
    sys.exit(importlib.import_module("experiments.__main__").main(sys.argv[1:]))
