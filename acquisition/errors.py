"""Exceptions of Traction: one base class, one subclass per kind of failure."""

from pathlib import Path
from typing import Any

# State of an arm without brakes while its windings are shorted.
IDLE_ARM = "idle; it sinks slowly, support it"


class TractionError(Exception):
    """Base of all errors with a message for the operator.

    Attributes:
        message: what happened, with numbers and limits.
        hint: what to do about it.
        arm_state: what the arm is doing now; "" if no arm is involved.
        saved: what was saved; "" if not applicable.
        exit_code: exit code of the command line.
    """

    exit_code = 1

    def __init__(
        self, message: str, *, hint: str = "", arm_state: str = "", saved: str = ""
    ) -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint
        self.arm_state = arm_state
        self.saved = saved

    def __reduce__(self) -> tuple[Any, ...]:
        """Support transfer between processes for any constructor signature."""
        return _restored, (type(self), self.args), vars(self)

    def __str__(self) -> str:
        arm = f"ARM: {self.arm_state}." if self.arm_state else ""
        return " ".join(
            part for part in (self.message, arm, self.hint, self.saved) if part
        )


def _restored(kind: type[TractionError], args: tuple[object, ...]) -> TractionError:
    return Exception.__new__(kind, *args)


class SettingsError(TractionError):
    """An invalid setting, argument or table."""

    exit_code = 2


class MissingLibraryError(SettingsError):
    """An optional library is not installed.

    Args:
        library: name in the package index.
        extra: extra of Traction that installs it.
    """

    def __init__(self, library: str, extra: str) -> None:
        super().__init__(
            f"This needs the library {library}, which is not installed.",
            hint=f"Install it with: python -m pip install 'traction[{extra}]'",
        )


class PreflightError(TractionError):
    """The rig is not ready to run."""

    exit_code = 3


class UnfitDeviceError(PreflightError):
    """A fault of a device, its cable or its power that prevents running."""


class LinkError(TractionError):
    """A bus or port cannot be opened or has failed."""

    exit_code = 4


class LinkFullError(LinkError):
    """The send queue of a bus is full."""


class LinkTimeoutError(LinkError):
    """A device did not answer in time."""


class DeviceFaultError(TractionError):
    """A device reported a fault or an invalid value."""

    exit_code = 4


class SessionError(TractionError):
    """A session cannot be opened, continued or closed as asked."""

    exit_code = 2


class TrialFileError(TractionError):
    """A trial file cannot be written or is invalid.

    Attributes:
        path: path of the file.
        reason: reason as text.
    """

    exit_code = 6

    def __init__(self, path: Path, reason: str, *, hint: str = "") -> None:
        super().__init__(f"{path}: {reason}.", hint=hint)
        self.path = path
        self.reason = reason
