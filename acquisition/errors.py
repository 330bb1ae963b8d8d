"""The errors of Traction: one root, one child per kind of failure."""

from pathlib import Path
from typing import Any

# What an arm without brakes does when its windings are shorted.
IDLE_ARM = "idle; it sinks slowly, support it"


class TractionError(Exception):
    """A failure that a person can understand and act on.

    Attributes:
        message: what happened, with numbers and limits.
        hint: what to do about it.
        arm_state: what the arm is doing now; empty if no arm is involved.
        saved: what was saved; empty if nothing was at stake.
        exit_code: exit code of the command line for this kind of failure.
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
        """Let another process raise it here, whatever its constructor takes."""
        return _restored, (type(self), self.args), vars(self)

    def __str__(self) -> str:
        arm = f"ARM: {self.arm_state}." if self.arm_state else ""
        return " ".join(
            part for part in (self.message, arm, self.hint, self.saved) if part
        )


def _restored(kind: type[TractionError], args: tuple[object, ...]) -> TractionError:
    return Exception.__new__(kind, *args)


class SettingsError(TractionError):
    """A setting, argument or table that cannot be used."""

    exit_code = 2


class MissingLibraryError(SettingsError):
    """A library that only some functions need is not installed.

    Args:
        library: its name in the package index.
        extra: the extra of Traction that installs it.
    """

    def __init__(self, library: str, extra: str) -> None:
        super().__init__(
            f"This needs the library {library}, which is not installed.",
            hint=f"Install it with: python -m pip install 'traction[{extra}]'",
        )


class PreflightError(TractionError):
    """The rig is not fit to run."""

    exit_code = 3


class UnfitDeviceError(PreflightError):
    """A device of the rig, its cable or its power does not let it run."""


class LinkError(TractionError):
    """A bus or port cannot be opened, or broke."""

    exit_code = 4


class LinkFullError(LinkError):
    """A bus takes nothing more: what was sent before has not left."""


class LinkTimeoutError(LinkError):
    """A device did not answer in time."""


class DeviceFaultError(TractionError):
    """A device answered that it is in trouble, or answered nonsense."""

    exit_code = 4


class SessionError(TractionError):
    """A session cannot be opened, continued or closed as asked."""

    exit_code = 2


class TrialFileError(TractionError):
    """A trial file cannot be written, or is not what it should be.

    Attributes:
        path: the file.
        reason: why, in words.
    """

    exit_code = 6

    def __init__(self, path: Path, reason: str, *, hint: str = "") -> None:
        super().__init__(f"{path}: {reason}.", hint=hint)
        self.path = path
        self.reason = reason
