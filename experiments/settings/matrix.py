"""What may stand in matrix.toml: the terrains and how they are pushed across."""

from typing import Annotated, Literal

from pydantic import Field

from acquisition.settings import File, Near, Number, SettingsSection, Vector3, Whole
from analysis.data.terrain_kinds import FLAT

_Angles = tuple[Near, Near, Near, Near, Near, Near, Near]
_Task = Annotated[str, Field(min_length=1, max_length=60, pattern=r"^[^\x00-\x1f]+$")]


class TerrainRow(SettingsSection):
    """One row of the matrix.

    `reset`: what a person does to the terrain before every trial. `target`: what the
    trials are to tell most about.
    """

    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9-]{0,15}$", examples=["S10"])
    stones: Literal["small", "big", "none"] = Field(examples=["small"])
    incline_deg: Number = Field(ge=0, le=30, examples=[10.0])
    foot: Literal["tread", "bare"] = Field(examples=["tread"])
    far_end: Vector3 = Field(examples=[[0.70, 0.0, 0.12]])
    heading_deg: Number = Field(ge=-180, le=180, examples=[0.0])
    travel: Number = Field(gt=0.05, le=1.0, examples=[0.45])
    trials: Whole = Field(ge=1, le=99, examples=[10])
    reset: tuple[_Task, ...] = Field(
        default=("rake", "level", "foot at the far end"),
        min_length=1,
        max_length=9,
        examples=[["rake", "level", "foot at the far end"]],
    )
    target: Literal["grid", "corner", "break-away"] = Field(
        default="grid", examples=["corner"]
    )
    start_q: _Angles = Field(examples=[[0, 0.77, 0, 1.19, 0, 1.19, 0]])
    calibration: File | None = Field(default=None, examples=["terrain_S10.toml"])

    @property
    def kind(self) -> str:
        """Kind of terrain: the size of its stones, or "flat" for a plate."""
        return FLAT if self.stones == "none" else self.stones


class MatrixSettings(SettingsSection):
    """Everything in matrix.toml."""

    terrains: tuple[TerrainRow, ...] = Field(min_length=1)
