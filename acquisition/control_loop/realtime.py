"""Real-time priority (SCHED_FIFO), processor core and memory lock of a process."""

import ctypes
import errno
import gc
import os
import struct
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

_MCL_CURRENT, _MCL_FUTURE = 1, 2
_NEEDS = {
    "SCHED_FIFO": "root, CAP_SYS_NICE or `ulimit -r`",
    "memory locked": "root, CAP_IPC_LOCK or `ulimit -l unlimited`",
    "processors awake": "root or a udev rule for /dev/cpu_dma_latency",
}
_LATENCY = Path("/dev/cpu_dma_latency")  # limit of the wake-up latency [us]
_NO_SLEEP = struct.pack("=i", 0)


@dataclass(frozen=True, slots=True)
class RealtimeRequest:
    """Requested real-time settings.

    Attributes:
        priority: SCHED_FIFO priority, 0 = normal scheduling.
        core: core to bind to; None = any.
        nice: nice value for normal scheduling.
        lock_memory: lock all memory and disable the garbage collector.
        limit_wakeup_latency: forbid deep idle states of the processors while
            the process lives; skipped if the Linux kernel has no such interface.
    """

    priority: int = 0
    core: int | None = None
    nice: int = 0
    lock_memory: bool = False
    limit_wakeup_latency: bool = False


@dataclass(frozen=True, slots=True)
class GrantResult:
    """Result of one request: name, whether granted, reason for a refusal."""

    what: str
    is_granted: bool
    reason: str = ""

    def as_dict(self) -> dict[str, object]:
        """Return the fields by name."""
        return asdict(self)


def choose_cores() -> tuple[int | None, int | None]:
    """Return (core of the loop, core of everything else); None if only one core."""
    if not hasattr(os, "sched_getaffinity"):
        return None, None
    cores = sorted(os.sched_getaffinity(0))
    return (cores[-1], cores[0]) if len(cores) > 1 else (None, None)


def request(wanted: RealtimeRequest) -> list[GrantResult]:
    """Apply the settings `wanted`; refusals are part of the result."""
    grants: list[GrantResult] = []
    if wanted.core is not None:
        core = wanted.core
        grants.append(_try(f"core {core}", lambda: os.sched_setaffinity(0, {core})))
    if wanted.priority:
        parameter = os.sched_param(wanted.priority)
        grants.append(
            _try(
                "SCHED_FIFO",
                lambda: os.sched_setscheduler(0, os.SCHED_FIFO, parameter),
            )
        )
    if wanted.nice:
        grants.append(_try(f"nice {wanted.nice}", lambda: _nice(wanted.nice)))
    if wanted.lock_memory:
        gc.collect()
        gc.freeze()
        gc.disable()
        grants.append(_try("memory locked", _lock_memory))
    if wanted.limit_wakeup_latency and _LATENCY.exists():
        grants.append(_try("processors awake", _stay_awake))
    return grants


def die_with_parent(signal_number: int) -> None:
    """Send this process a signal when its parent dies."""
    pr_set_pdeathsig = 1
    ctypes.CDLL(None, use_errno=True).prctl(pr_set_pdeathsig, signal_number)


def page_faults() -> int:
    """Return the number of page faults of this process, minor ones included."""
    import resource

    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_minflt + usage.ru_majflt


def _nice(value: int) -> None:
    os.setpriority(os.PRIO_PROCESS, 0, value)


def _lock_memory() -> None:
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.mlockall(_MCL_CURRENT | _MCL_FUTURE):
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))


def _stay_awake() -> None:
    """Request zero wake-up latency, in effect while the descriptor is open.

    The descriptor is left open until the process ends; children do not inherit it.
    """
    os.write(os.open(_LATENCY, os.O_WRONLY), _NO_SLEEP)


def _try(what: str, call: Callable[[], object]) -> GrantResult:
    try:
        call()
    except OSError as error:
        name = errno.errorcode.get(error.errno or 0, "error")
        needs = f"; needs {_NEEDS[what]}" if what in _NEEDS else ""
        return GrantResult(what, is_granted=False, reason=f"{name}{needs}")
    return GrantResult(what, is_granted=True)
