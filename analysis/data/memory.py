"""Limit on the memory that the contents of a file may take."""

import contextlib
from pathlib import Path

_MEMORY = Path("/proc/meminfo")
_OWN = Path("/proc/self/statm")  # first field: pages of this process
_GROUP = Path("/sys/fs/cgroup")  # of a container or a cluster job


def share_of_memory(part: int, least: int) -> int:
    """Return 1/`part` of the free memory [bytes], at least `least`.

    Free memory is the kernel's MemAvailable, or what the limits of this process or its
    cgroup leave if that is less.
    """
    return max(least, _free() // part)


def _free() -> int:
    """Return the free memory [bytes], 0 where it is not known."""
    limits: list[int] = []
    with contextlib.suppress(OSError, ValueError, IndexError):
        text = _MEMORY.read_text().partition("MemAvailable:")[2]
        limits.append(1024 * int(text.split()[0]))
    with contextlib.suppress(OSError, ValueError):  # "max" where there is no limit
        limit, used = (
            int((_GROUP / f"memory.{name}").read_text()) for name in ("max", "current")
        )
        limits.append(max(limit - used, 0))
    with contextlib.suppress(ImportError, OSError, ValueError, IndexError):
        import resource  # only Unix has it

        limit, _ = resource.getrlimit(resource.RLIMIT_AS)
        if limit != resource.RLIM_INFINITY:
            used = int(_OWN.read_text().split()[0]) * resource.getpagesize()
            limits.append(max(limit - used, 0))
    return min(limits, default=0)
