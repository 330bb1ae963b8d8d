"""Connect the rig, or explain why the arm cannot be reached."""

from acquisition.errors import (
    DeviceFaultError,
    LinkError,
    LinkFullError,
    LinkTimeoutError,
    PreflightError,
    TractionError,
    UnfitDeviceError,
)
from experiments.messages import preflight_error
from experiments.rig.rig import FakeOptions, Rig, build_rig
from experiments.settings.load import Settings
from experiments.settings.matrix import TerrainRow
from experiments.settings.rig import RigSettings


def connect_rig(
    settings: Settings,
    row: TerrainRow,
    fake: FakeOptions | None,
) -> Rig:
    """Return the rig with its bus open.

    Args:
        settings: all settings.
        row: row of the matrix.
        fake: options of a simulation; None = the real rig.

    Raises:
        PreflightError: the CAN interface cannot be used.
    """
    try:
        return build_rig(settings, row, fake)
    except LinkError as error:
        raise not_reached(error, settings.rig) from error


def not_reached(error: TractionError, settings: RigSettings) -> PreflightError:
    """Return the error for an arm that cannot be reached, or answers wrongly.

    A bus that is down gets the message of the catalogue, with the command to start it.
    """
    is_up = isinstance(error, LinkTimeoutError | LinkFullError)
    is_bus = isinstance(error, LinkError) and not is_up
    can = settings.can
    if not is_bus or can.interface != "socketcan":
        return as_preflight(error, "not touched")
    fields = {"channel": can.channel, "bitrate": can.bitrate}
    return preflight_error("can-down", detail=error.message, **fields)


def as_preflight(error: TractionError, arm_state: str) -> PreflightError:
    """Return `error` as a preflight error, with `arm_state` if it has none."""
    arm_state = error.arm_state or arm_state
    is_of_device = isinstance(error, LinkError | DeviceFaultError | UnfitDeviceError)
    kind = UnfitDeviceError if is_of_device else PreflightError
    return kind(error.message, hint=error.hint, arm_state=arm_state)
