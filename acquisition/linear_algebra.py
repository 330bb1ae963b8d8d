"""Settings of OpenBLAS and malloc for matrices of a few hundred rows.

Environment variables, set before numpy loads OpenBLAS: one thread, because more would
wait for busy cores; and its matrix routines for processors newer than the library.
OpenBLAS 0.3.31 knows AMD families up to 25 and treats later ones as a Haswell of 2013,
whose matrix products take a third longer.

By default glibc maps, clears and unmaps every temporary matrix of this size, and with
other threads each unmapping interrupts the other cores (TLB shootdown). Two workers of
a Dask cluster on two cores were only 1.26 times as fast as one because of that;
`python -m benchmarks` measures it.
"""

import ctypes
from contextlib import suppress
from functools import cache
from pathlib import Path

ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in ("OPENBLAS", "OMP")}

_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3  # parameters of mallopt(3)
_KEPT = 256 * 2**20  # free bytes kept at the end of the heap
_LARGEST = 32 * 2**20  # largest block from the heap [bytes]; the maximum of glibc
_CPU = Path("/proc/cpuinfo")
_FIRST = 8192  # bytes; enough for the first core's entry
_LAST_KNOWN = 25  # newest AMD family supported by OpenBLAS
_AVX512 = frozenset({"avx512f", "avx512dq", "avx512bw", "avx512vl", "avx512cd"})


def openblas_settings(cpu: Path = _CPU) -> dict[str, str]:
    """Return environment variables for OpenBLAS on this processor.

    Args:
        cpu: description of the processor by Linux; missing on other systems.
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
def keep_heap() -> bool:
    """Let malloc keep large freed blocks for the next matrix.

    Returns:
        Whether mallopt succeeded; otherwise computations are slower.
    """
    with suppress(OSError, AttributeError):
        mallopt = ctypes.CDLL(None).mallopt
        options = ((_MMAP_THRESHOLD, _LARGEST), (_TRIM_THRESHOLD, _KEPT))
        return all(mallopt(name, size) for name, size in options)
    return False
