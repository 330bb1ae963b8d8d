"""The heap of this process, given back to the kernel after a trial."""

import ctypes


def give_back_heap() -> None:
    """Return memory that is free to the kernel, where the C library can do so.

    What a finished trial has used would otherwise stay with its process in pieces.
    """
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)
