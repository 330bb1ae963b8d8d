"""Which arm a file belongs to: the serial numbers of its seven motor pucks."""

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
    """Refuse what was measured on another arm; what is unknown is no contradiction.

    Args:
        name: of the file or setting.
        noted: serial numbers of the seven pucks that it was measured with; None = it
            does not say.
        pucks: serial numbers of this arm's, None where a puck does not say.

    Raises:
        SettingsError: a puck has another serial number.
    """
    if noted is None:
        return
    pairs = list(zip(noted, pucks, strict=True))
    others = [
        f"puck {number} was {theirs}, is {ours}"
        for number, (theirs, ours) in enumerate(pairs, 1)
        if ours is not None and ours != theirs
    ]
    if others:
        which = "another arm" if len(others) == len(pairs) else "other pucks"
        raise SettingsError(
            f"{name} was measured with {which}: {', '.join(others)}.",
            hint="Name the file of this arm, or calibrate again; after a repair zero "
            "the arm anew.",
        )
