"""Advisory file locks (flock), released when the process ends.

On a system without flock every lock succeeds.
"""


def try_lock(descriptor: int, *, is_shared: bool = False, without: bool = True) -> bool:
    """Try to lock an open file; return False if another process holds the lock.

    Args:
        descriptor: descriptor of the file or folder.
        is_shared: shared lock instead of an exclusive one.
        without: result on a file system without locks.
    """
    try:
        _lock(descriptor, is_shared=is_shared, is_awaited=False)
    except BlockingIOError:
        return False
    except OSError:  # a file system without locks
        return without
    return True


def wait_for_lock(descriptor: int) -> None:
    """Lock an open file exclusively, waiting for its release.

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
