"""What a database knows of terrains besides their tables: named parts, as plain values.

    of a terrain   break_away   its `BreakAwayModel`
                   roughness    {window: least feature `resid` of its own windows}
    of all         surfaces     the `SurfaceClassifier`

A part that this program does not know is kept as it is.
"""

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Field, TypeAdapter

from acquisition.errors import SettingsError
from acquisition.validation import Entries, first_problem
from analysis.breakaway.model import BreakAwayModel
from analysis.terrains.classifier import SurfaceClassifier

BREAK_AWAY_PART, ROUGHNESS_PART, SURFACES_PART = "break_away", "roughness", "surfaces"
Parts = Mapping[str, Any]
_ROUGHNESS = TypeAdapter(Entries[int, Annotated[float, Field(allow_inf_nan=False)]])


def checked_parts(parts: Parts) -> Parts:
    """Return the parts in a file after reading every one that is known.

    Raises:
        ValueError: a part is not what it should be.
    """
    for name, read in _READERS.items():
        try:
            if name in parts:
                read(parts)
        except ValueError as error:
            raise ValueError(f"{name}: {first_problem(error)}") from error
    return parts


def break_away_in(parts: Parts, terrain: str) -> BreakAwayModel:
    """Return what a terrain gives before a foot at rest slips.

    Raises:
        SettingsError: it is not known.
    """
    if BREAK_AWAY_PART not in parts:
        raise SettingsError(
            f"{terrain}: the force before it slips from rest is not known.",
            hint="Record three trials or more; risk_in_motion answers for sliding.",
        )
    return BreakAwayModel.from_dict(parts[BREAK_AWAY_PART])


def roughness_in(parts: Parts) -> dict[int, float]:
    """Return the least roughness by window [kept samples], empty where not known."""
    return _ROUGHNESS.validate_python(parts.get(ROUGHNESS_PART, {}))


def surfaces_in(parts: Parts) -> SurfaceClassifier | None:
    """Return the classifier of flat and rocky ground, None where there is none."""
    if SURFACES_PART not in parts:
        return None
    return SurfaceClassifier.from_dict(parts[SURFACES_PART])


_READERS = {
    BREAK_AWAY_PART: lambda parts: break_away_in(parts, ""),
    ROUGHNESS_PART: roughness_in,
    SURFACES_PART: surfaces_in,
}
