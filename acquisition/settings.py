"""What the sections of a settings file in TOML are made of."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

# strict: a number in quotes, or `true`, is a mistake and no number
Number = Annotated[float, Field(strict=True)]
Whole = Annotated[int, Field(strict=True)]
Positive = Annotated[Number, Field(gt=0, allow_inf_nan=False)]
Mass = Annotated[Number, Field(gt=0, le=20)]
Near = Annotated[Number, Field(ge=-10, le=10)]  # metres and radians of this room
Vector3 = tuple[Near, Near, Near]
Six = tuple[Number, Number, Number, Number, Number, Number]
File = Annotated[str, Field(min_length=1, max_length=4096)]  # beside rig.toml


class SettingsSection(BaseModel):
    """A table of a settings file: unknown keys and infinite numbers are mistakes."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
