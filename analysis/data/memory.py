"""How much of the computer's memory what a file holds may take."""

import contextlib
from pathlib import Path

_MEMORY = Path("/proc/meminfo")
_OWN = Path("/proc/self/statm")  # begins with the pages of this process
_GROUP = Path("/sys/fs/cgroup")  # of a container, or of a job of a cluster


def share_of_memory(part: int, least: int) -> int:
    """Return one part in `part` of the memory that is free [bytes], at least `least`.

    Free is what the kernel calls available, or what this process or its group may still
    take where that is less.
    """
    return max(least, _free() // part)


def _free() -> int:
    """Return the free memory [bytes], 0 where it is not known."""
    found: list[int] = []
    with contextlib.suppress(OSError, ValueError, IndexError):
        text = _MEMORY.read_text().partition("MemAvailable:")[2]
        found.append(1024 * int(text.split()[0]))
    with contextlib.suppress(OSError, ValueError):  # "max" where there is no limit
        most, used = (
            int((_GROUP / f"memory.{name}").read_text()) for name in ("max", "current")
        )
        found.append(max(most - used, 0))
    with contextlib.suppress(ImportError, OSError, ValueError, IndexError):
        import resource  # only Unix has it

        most, _ = resource.getrlimit(resource.RLIMIT_AS)
        if most != resource.RLIM_INFINITY:
            used = int(_OWN.read_text().split()[0]) * resource.getpagesize()
            found.append(max(most - used, 0))
    return min(found, default=0)
