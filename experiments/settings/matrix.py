"""What may stand in matrix.toml: the terrains and how they are pushed across."""

from typing import Annotated, Literal

from pydantic import Field

from acquisition.settings import File, Number, SettingsSection, Usual, Whole
from analysis.data.terrain_kinds import FLAT

_Across = Annotated[Number, Field(ge=-1.2, le=1.2), Usual(-1.0, 1.0, "m")]
_Up = Annotated[Number, Field(ge=-0.5, le=1.0), Usual(-0.4, 0.6, "m")]
_Place = tuple[_Across, _Across, _Up]  # what the arm reaches
# The stops of the joints, as in wam7.toml.
_Angles = tuple[
    Annotated[Number, Field(ge=-2.6, le=2.6), Usual(-2.5, 2.5, "rad")],
    Annotated[Number, Field(ge=-2.0, le=2.0), Usual(-1.9, 1.9, "rad")],
    Annotated[Number, Field(ge=-2.8, le=2.8), Usual(-2.7, 2.7, "rad")],
    Annotated[Number, Field(ge=-0.9, le=3.1), Usual(-0.8, 3.0, "rad")],
    Annotated[Number, Field(ge=-4.76, le=1.24), Usual(-4.66, 1.14, "rad")],
    Annotated[Number, Field(ge=-1.6, le=1.6), Usual(-1.5, 1.5, "rad")],
    Annotated[Number, Field(ge=-3.0, le=3.0), Usual(-2.9, 2.9, "rad")],
]
_Task = Annotated[str, Field(min_length=1, max_length=60, pattern=r"^[^\x00-\x1f]+$")]


class TerrainRow(SettingsSection):
    """One row of the matrix.

    `reset`: what a person does to the terrain before every trial. `target`: what the
    trials are to tell most about.
    """

    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9-]{0,15}$", examples=["S10"])
    stones: Literal["small", "big", "none"] = Field(examples=["small"])
    incline_deg: Annotated[Number, Usual(0.0, 20.0, "degrees")] = Field(
        ge=0, le=30, examples=[10.0]
    )
    foot: Literal["tread", "bare"] = Field(examples=["tread"])
    far_end: _Place = Field(examples=[[0.70, 0.0, 0.12]])
    heading_deg: Annotated[Number, Usual(-180.0, 180.0, "degrees")] = Field(
        ge=-180, le=180, examples=[0.0]
    )
    travel: Annotated[Number, Usual(0.05, 0.7, "m")] = Field(
        gt=0.05, le=1.0, examples=[0.45]
    )
    trials: Annotated[Whole, Usual(1, 30)] = Field(ge=1, le=99, examples=[10])
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
