"""Advisory locks of open files; the death of a process opens those it has.

An operating system without them locks nothing: everything is free.
"""


def try_lock(descriptor: int, *, is_shared: bool = False, without: bool = True) -> bool:
    """Take the lock of an open file; return False where another process has it.

    Args:
        descriptor: of the file or folder.
        is_shared: others may have it at the same time, if they share it too.
        without: what is returned where a file system has no locks.
    """
    try:
        _lock(descriptor, is_shared=is_shared, is_awaited=False)
    except BlockingIOError:
        return False
    except OSError:  # a file system without locks
        return without
    return True


def wait_for_lock(descriptor: int) -> None:
    """Take the lock of an open file as soon as nobody else has it.

    Raises:
        OSError: the file system has no locks.
    """
    _lock(descriptor, is_shared=False, is_awaited=True)


def _lock(descriptor: int, *, is_shared: bool, is_awaited: bool) -> None:
    try:
        import fcntl
    except ImportError:  # Windows
        return
    kind = fcntl.LOCK_SH if is_shared else fcntl.LOCK_EX
    fcntl.flock(descriptor, kind if is_awaited else kind | fcntl.LOCK_NB)
