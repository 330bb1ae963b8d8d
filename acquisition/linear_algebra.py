"""What OpenBLAS and the C library are told for matrices of a few hundred rows.

By the environment, before numpy loads OpenBLAS: one thread, since more would wait for
busy cores; and where a processor is newer than the library, which of its kernels to
take. OpenBLAS 0.3.31 knows AMD's families up to 25 and takes later ones for a Haswell
of 2013, whose products take a third longer.

Such matrices are too large for the heap of the C library as it comes: every temporary
one is mapped, cleared and unmapped again, and with threads beside it each unmapping
interrupts the other cores. Two workers of a Dask cluster on two cores were 1.26 times
as fast as one by that; `python -m benchmarks` has the figure of today.
"""

import ctypes
from contextlib import suppress
from functools import cache
from pathlib import Path

ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in ("OPENBLAS", "OMP")}

_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3  # parameters of mallopt(3)
_KEPT = 256 * 2**20  # bytes of freed memory at the end of the heap
_LARGEST = 32 * 2**20  # bytes from the heap at most; glibc takes no more
_CPU = Path("/proc/cpuinfo")
_FIRST = 8192  # bytes that hold what is said of the first core
_LAST_KNOWN = 25  # family of AMD's processors
_AVX512 = frozenset({"avx512f", "avx512dq", "avx512bw", "avx512vl", "avx512cd"})


def openblas_settings(cpu: Path = _CPU) -> dict[str, str]:
    """Return variables of the environment and their values.

    Args:
        cpu: where Linux describes the processor; elsewhere it is not there.
    """
    try:
        with cpu.open("rb") as file:
            text = file.read(_FIRST).decode("ascii", "replace")
    except OSError:
        return ONE_THREAD
    pairs = (
        line.partition(":")[::2] for line in text.partition("\n\n")[0].splitlines()
    )
    fields = {name.strip(): value.strip() for name, value in pairs}
    family = fields.get("cpu family", "")
    is_newer = family.isdecimal() and int(family) > _LAST_KNOWN
    if fields.get("vendor_id") != "AuthenticAMD" or not is_newer:
        return ONE_THREAD
    if not set(fields.get("flags", "").split()) >= _AVX512:
        return ONE_THREAD
    return ONE_THREAD | {"OPENBLAS_CORETYPE": "SkylakeX"}


@cache
def keep_memory() -> bool:
    """Let the C library keep large blocks that are freed, for the next matrix.

    Returns:
        whether it can be asked to; without, work takes longer.
    """
    with suppress(OSError, AttributeError):
        mallopt = ctypes.CDLL(None).mallopt
        asked = ((_MMAP_THRESHOLD, _LARGEST), (_TRIM_THRESHOLD, _KEPT))
        return all(mallopt(name, size) for name, size in asked)
    return False
