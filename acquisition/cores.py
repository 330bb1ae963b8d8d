"""Number of cores available to this process."""

import os


def available_cores() -> int:
    """Return the number of cores in this process's affinity mask."""
    if hasattr(os, "sched_getaffinity"):
        return max(1, len(os.sched_getaffinity(0)))
    return os.cpu_count() or 1
