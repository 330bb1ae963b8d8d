"""The matrix: what stands in matrix.toml once it is read, a row per terrain.

The file names factors, cells and crosses; `design` makes the rows.
"""

import math
from typing import Annotated, Any, Literal, Self

from pydantic import Field, StringConstraints, model_validator

from acquisition.settings import File, Number, SettingsSection, UsualRange, Whole
from analysis.data.terrain_kinds import Value, terrain_kind

MOST_FACTORS = 12
LONGEST_WORD = 40
_Across = Annotated[Number, Field(ge=-1.2, le=1.2), UsualRange(-1.0, 1.0, "m")]
_Up = Annotated[Number, Field(ge=-0.5, le=1.0), UsualRange(-0.4, 0.6, "m")]
FarEnd = tuple[_Across, _Across, _Up]  # what the arm reaches
# The stops of the joints, as in wam7.toml.
Angles = tuple[
    Annotated[Number, Field(ge=-2.6, le=2.6), UsualRange(-2.5, 2.5, "rad")],
    Annotated[Number, Field(ge=-2.0, le=2.0), UsualRange(-1.9, 1.9, "rad")],
    Annotated[Number, Field(ge=-2.8, le=2.8), UsualRange(-2.7, 2.7, "rad")],
    Annotated[Number, Field(ge=-0.9, le=3.1), UsualRange(-0.8, 3.0, "rad")],
    Annotated[Number, Field(ge=-4.76, le=1.24), UsualRange(-4.66, 1.14, "rad")],
    Annotated[Number, Field(ge=-1.6, le=1.6), UsualRange(-1.5, 1.5, "rad")],
    Annotated[Number, Field(ge=-3.0, le=3.0), UsualRange(-2.9, 2.9, "rad")],
]
Heading = Annotated[
    Number, Field(ge=-180, le=180), UsualRange(-180.0, 180.0, "degrees")
]
Travel = Annotated[Number, Field(gt=0.05, le=1.0), UsualRange(0.05, 0.7, "m")]
Incline = Annotated[Number, Field(ge=-30, le=30), UsualRange(-20.0, 20.0, "degrees")]
Trials = Annotated[Whole, Field(ge=1, le=99), UsualRange(1, 30)]
PlaceName = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_-]{0,23}$")]
FootName = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]{0,15}$")]
CellName = Annotated[  # a point stands before a digit only
    str,
    Field(max_length=24, pattern=r"^[A-Za-z0-9](?:[A-Za-z0-9+-]|\.[0-9])*$"),
]
GroundWord = Literal["stones", "plate", "fine"]
Push = Literal[0, 180]
_Text = Annotated[str, Field(min_length=1, max_length=60, pattern=r"^[^\x00-\x1f]+$")]
Tasks = Annotated[tuple[_Text, ...], Field(min_length=1, max_length=9)]
RESET = ("rake", "level", "foot at the far end")
Word = Annotated[
    str,
    StringConstraints(
        pattern=r"^[A-Za-z0-9][A-Za-z0-9 ._+/-]*$", max_length=LONGEST_WORD
    ),
]


class DesignFactor(SettingsSection):
    """Something that varies between the cells.

    Attributes:
        name: the key of the cells that states it.
        unit: of a number; "" = none.
        kind: a number, or one of `levels`.
        scale: on which numbers are compared.
        levels: the words that a cell may state.
        words: what a word means, for people.
    """

    name: Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]{0,23}$")] = Field(
        examples=["moisture"]
    )
    unit: Annotated[str, Field(max_length=16, pattern=r"^[^\x00-\x1f]*$")] = ""
    kind: Literal["number", "word"] = Field(examples=["word"])
    scale: Literal["linear", "log"] = "linear"
    levels: tuple[Word, ...] = Field(default=(), max_length=60)
    words: dict[Word, _Text] = Field(default_factory=dict[str, str])

    @model_validator(mode="after")
    def _fits_its_kind(self) -> Self:
        if self.kind == "word":
            if not self.levels or len(set(self.levels)) < len(self.levels):
                raise ValueError(
                    'a word needs levels, each once, e.g. levels = ["dry", "wet"]'
                )
            if self.unit or self.scale != "linear":
                raise ValueError("a word has no unit and no scale")
        elif self.levels or self.words:
            raise ValueError("a number has no levels and no words")
        if strange := sorted(set(self.words) - set(self.levels)):
            raise ValueError(f"words explains {strange[0]!r}, which is no level")
        if self.name == "d50" and (self.kind, self.unit) != ("number", "mm"):
            raise ValueError('d50 is the grain size: kind = "number", unit = "mm"')
        return self

    def check(self, value: Value) -> str:
        """Return what is wrong with a value of this factor, "" for nothing."""
        if value is None:
            return ""
        if self.kind == "word":
            if value in self.levels:
                return ""
            return f"one of {', '.join(self.levels)}" + ' or "-"'
        if isinstance(value, str) or not math.isfinite(value):
            return 'a finite number or "-"'
        if (self.scale == "log" or self.name == "d50") and value <= 0.0:
            return "a number above 0"
        return ""


class Design(SettingsSection):
    """In which order the cells are recorded.

    Attributes:
        order: by chance against drift, as the rows stand, or by chance within blocks.
        block_by: keys of the cells that are hard to change: those alike are done in
            one go.
        repeat_blocks: how often all cells are recorded again, on another day.
        seed: of the random order.
    """

    order: Literal["randomised", "rows", "blocked"] = "randomised"
    block_by: tuple[Annotated[str, Field(max_length=24)], ...] = Field(
        default=(), max_length=4
    )
    repeat_blocks: Annotated[Whole, Field(ge=0, le=9)] = 0
    seed: Annotated[Whole, Field(ge=0, le=2**31)] = 1


class TerrainRow(SettingsSection):
    """One row of the matrix: a terrain, the foot, the way across, the factors.

    Attributes:
        name: of the terrain.
        foot: of rig.toml.
        far_end: where the foot starts, in the base frame [m].
        heading_deg: direction from the base to the container [degrees].
        travel: length of a push [m].
        trials: how many are to be kept.
        reset: what a person does to the terrain before every trial.
        calibration: file of the container as calibrated; None = it was not.
        stones: size of the stones as recordings state it: small, big, none, e.g.
            "12 mm", "fine", or "stones" of unknown size.
        incline_deg: of the container, positive where its far end is high [degrees].
        push_deg: direction of the push against x_T [degrees]: 0 = toward the base, 180
            = away from it, from the near end.
        start_q: joints with the foot at the far end [rad]; None = computed.
        place: of rig.toml, where the container stands; None = its own.
        taught: file of `place` as taught by hand; None = it was not.
        factors: values by name of the factor; None = does not apply.
        simulate: by parameter of the simulated ground, what its words multiply it by.
    """

    name: CellName
    foot: FootName
    far_end: FarEnd
    heading_deg: Heading
    travel: Travel
    trials: Trials
    reset: Tasks = RESET
    calibration: File | None = None
    stones: Annotated[str, Field(max_length=24)]
    incline_deg: Incline
    push_deg: Push = 0
    start_q: Angles | None = None
    place: str | None = None
    taught: File | None = None
    factors: dict[str, float | str | None] = Field(
        default_factory=dict[str, "float | str | None"]
    )
    simulate: dict[str, float] = Field(default_factory=dict[str, float])

    @property
    def kind(self) -> str:
        """Kind of terrain: the size of its stones, or "flat" for a plate."""
        return terrain_kind(self.name, [self.stones])

    def as_container(self) -> "TerrainRow":
        """Return it as its container stands, whichever way it is crossed."""
        return self if self.push_deg == 0 else self.model_copy(update={"push_deg": 0})

    def plain(self) -> dict[str, Any]:
        """Return it in plain values, without what only few rows state."""
        values = self.model_dump(mode="json")
        few = ("push_deg", "place", "taught", "factors", "simulate")
        return {k: v for k, v in values.items() if k not in few or v}


class MatrixSettings(SettingsSection):
    """The whole matrix."""

    terrains: tuple[TerrainRow, ...] = Field(min_length=1)
    factors: tuple[DesignFactor, ...] = ()
    design: Design = Design()
