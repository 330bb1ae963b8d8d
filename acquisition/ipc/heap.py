"""Return of free heap memory to the Linux kernel after a trial."""

import ctypes


def trim_heap() -> None:
    """Return free heap memory to the Linux kernel, if the C library has malloc_trim.

    Otherwise the fragmented heap of a finished trial stays with the process.
    """
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)
