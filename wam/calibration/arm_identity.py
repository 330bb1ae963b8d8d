"""Arm identity of a calibration file: serial numbers of the seven motor pucks."""

from collections.abc import Sequence
from typing import Annotated

from pydantic import Field

from acquisition.errors import SettingsError
from acquisition.settings import Whole

_Serial = Annotated[Whole, Field(ge=0, lt=2**31)]
SerialNumbers = tuple[_Serial, _Serial, _Serial, _Serial, _Serial, _Serial, _Serial]


def check_same_arm(
    name: str, noted: Sequence[int] | None, pucks: Sequence[int | None]
) -> None:
    """Refuse a calibration of another arm; unknown serial numbers are accepted.

    Args:
        name: name of the file or setting.
        noted: serial numbers of the seven pucks in the file; None = not recorded.
        pucks: serial numbers of this arm's seven pucks, None = unknown.

    Raises:
        SettingsError: a puck has another serial number.
    """
    if noted is None:
        return
    pairs = list(zip(noted, pucks, strict=True))
    mismatches = [
        f"puck {number} was {theirs}, is {ours}"
        for number, (theirs, ours) in enumerate(pairs, 1)
        if ours is not None and ours != theirs
    ]
    if mismatches:
        which = "another arm" if len(mismatches) == len(pairs) else "other pucks"
        raise SettingsError(
            f"{name} was measured with {which}: {', '.join(mismatches)}.",
            hint="Name the file of this arm, or calibrate again; after a repair zero "
            "the arm anew.",
        )
