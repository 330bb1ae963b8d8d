"""What OpenBLAS is told by the environment, before numpy loads it.

One thread: more would wait for busy cores. And where a processor is newer than the
library, which of its kernels to take: OpenBLAS 0.3.31 knows AMD's families up to 25 and
takes later ones for a Haswell of 2013, whose products take a third longer.
"""

from pathlib import Path

ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in ("OPENBLAS", "OMP")}

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
    said = {name.strip(): value.strip() for name, value in pairs}
    family = said.get("cpu family", "")
    is_newer = family.isdecimal() and int(family) > _LAST_KNOWN
    if said.get("vendor_id") != "AuthenticAMD" or not is_newer:
        return ONE_THREAD
    if not set(said.get("flags", "").split()) >= _AVX512:
        return ONE_THREAD
    return ONE_THREAD | {"OPENBLAS_CORETYPE": "SkylakeX"}
