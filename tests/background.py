"""Signals in a program that a shell started in the background."""

import signal


def restore_signals() -> None:
    """Restore the handling of SIGINT and SIGHUP.

    A shell that starts a program in the background, or nohup, makes it ignore signals
    that tests send, and every program that a test starts would inherit that.
    """
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
