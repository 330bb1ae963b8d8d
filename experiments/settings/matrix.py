"""The matrix: content of matrix.toml, one row per terrain.

The file defines factors, cells and crosses; `design` resolves them into rows.
"""

import math
from typing import Annotated, Any, Literal, Self

from pydantic import Field, StringConstraints, model_validator

from acquisition.settings import File, Number, SettingsSection, UsualRange, Whole
from analysis.data.terrain_kinds import Value, terrain_kind

MAX_FACTORS = 12
LONGEST_WORD = 40
_Across = Annotated[Number, Field(ge=-1.2, le=1.2), UsualRange(-1.0, 1.0, "m")]
_Up = Annotated[Number, Field(ge=-0.5, le=1.0), UsualRange(-0.4, 0.6, "m")]
FarEnd = tuple[_Across, _Across, _Up]  # within reach of the arm
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
CellName = Annotated[  # a point only before a digit
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
    """A factor of the experimental design.

    Attributes:
        name: key in the cells.
        unit: unit of a number; "" = none.
        kind: a number, or one of `levels`.
        scale: scale on which numbers are compared.
        levels: permitted words.
        words: meanings of the words, for people.
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
        if unknown := sorted(set(self.words) - set(self.levels)):
            raise ValueError(f"words explains {unknown[0]!r}, which is no level")
        if self.name == "d50" and (self.kind, self.unit) != ("number", "mm"):
            raise ValueError('d50 is the grain size: kind = "number", unit = "mm"')
        return self

    def check(self, value: Value) -> str:
        """Return the expected values if `value` is invalid, else ""."""
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
    """Order of the recordings.

    Attributes:
        order: randomised against drift, in the order of the rows, or randomised in
            blocks.
        block_by: hard-to-change keys of the cells; cells with equal values form a
            block.
        repeat_blocks: number of repetitions of all cells, on other days.
        seed: seed of the random order.
    """

    order: Literal["randomised", "rows", "blocked"] = "randomised"
    block_by: tuple[Annotated[str, Field(max_length=24)], ...] = Field(
        default=(), max_length=4
    )
    repeat_blocks: Annotated[Whole, Field(ge=0, le=9)] = 0
    seed: Annotated[Whole, Field(ge=0, le=2**31)] = 1


class TerrainRow(SettingsSection):
    """One row of the matrix: terrain, foot, push and factors.

    Attributes:
        name: name of the terrain.
        foot: a foot of rig.toml.
        far_end: start of the foot, in the base frame [m].
        heading_deg: direction from the base to the container [degrees].
        travel: length of a push [m].
        trials: number of trials to keep.
        reset: steps that restore the terrain before every trial.
        calibration: file of the container's calibration; None = not calibrated.
        stones: size of the stones as recordings state it: small, big, none, e.g.
            "12 mm", "fine", or "stones" of unknown size.
        incline_deg: incline of the container, positive if its far end is high
            [degrees].
        push_deg: direction of the push against x_T [degrees]: 0 = toward the base, 180
            = away from it, from the near end.
        start_q: joint angles with the foot at the far end [rad]; None = computed.
        place: place of the container in rig.toml; None = its own.
        taught: file of the taught `place`; None = not taught.
        factors: values by name of the factor; None = does not apply.
        simulate: multipliers of the simulated ground, by parameter.
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
        """Return the row with the frame of its container, for either push direction."""
        return self if self.push_deg == 0 else self.model_copy(update={"push_deg": 0})

    def plain(self) -> dict[str, Any]:
        """Return plain values, without unset optional fields."""
        values = self.model_dump(mode="json")
        optional = ("push_deg", "place", "taught", "factors", "simulate")
        return {k: v for k, v in values.items() if k not in optional or v}


class MatrixSettings(SettingsSection):
    """The whole matrix."""

    terrains: tuple[TerrainRow, ...] = Field(min_length=1)
    factors: tuple[DesignFactor, ...] = ()
    design: Design = Design()
