"""What foresight has learnt, and on which rig: plain values in and out."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from operator import methodcaller
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    Field,
    ValidationInfo,
    field_validator,
)

from acquisition.schema import MOST_TERRAINS
from acquisition.validation import Entries, Many
from analysis.data.recorded_factors import foot_of
from analysis.foresight.ground import GroundLaw, GroundModel
from analysis.foresight.ground_window import GROUND_FEATURES, WINDOWS
from analysis.foresight.logistic import RidgeLogistic
from analysis.foresight.signals import FEATURES
from analysis.foresight.stored import Number, Word

VERSION = 1
_MOST_RIGS, _MOST_NAMES = 100, 5000
_Names = Annotated[Many[Word], Field(max_length=_MOST_NAMES)]


def _is_for(features: Sequence[str]) -> AfterValidator:
    """Return the check that a regression is one on these features."""
    return AfterValidator(methodcaller("checked", len(features)))


@dataclass(frozen=True, slots=True)
class RigIdentity:
    """What a trial states of foot and rig, as text.

    Attributes:
        simulated: "true" or "false".
        tread: which foot: "true" with its tread, "false" bare, or its name.
        effective_mass_kg: of the arm at the sole.
        foot_mass_kg: of the foot.
    """

    simulated: Word = ""
    tread: Word = ""
    effective_mass_kg: Word = ""
    foot_mass_kg: Word = ""

    @classmethod
    def of(cls, trial: Mapping[str, str]) -> "RigIdentity":
        """Return the identity in a trial's metadata; "" for what is not stated."""
        return cls(*(str(trial.get(name, "")) for name in cls.__slots__))

    def to_dict(self) -> dict[str, str]:
        """Return it as a mapping, as in a trial's metadata."""
        return asdict(self)

    @property
    def text(self) -> str:
        """The identity in words."""
        foot = foot_of(self.tread) or "?"
        kind = "simulated" if self.simulated == "true" else "live"
        return (
            f"{kind} rig, {foot} foot of {self.foot_mass_kg or '?'} kg, effective mass "
            f"{self.effective_mass_kg or '?'} kg"
        )


@dataclass(frozen=True, slots=True)
class Provenance:
    """What a model was learnt from.

    Attributes:
        rigs: feet and rigs.
        trials: names of the trials.
        seeds: of the simulations, empty where there was none.
    """

    rigs: Annotated[Many[RigIdentity], Field(max_length=_MOST_RIGS)]
    trials: _Names
    seeds: _Names


@dataclass(frozen=True, slots=True)
class SlipModel:
    """Probability of a slip within 200 ms.

    Attributes:
        threshold: probability at which an alarm begins, set on trials that the
            regression of their fold had not seen.
        slips: number of slips that it was learnt from.
        reach: F_n and F_t [N] beyond which nothing was learnt.
        regression: on the features of `signals`.
    """

    threshold: Annotated[float, Field(gt=0.0, lt=1.0)]
    slips: Annotated[int, Field(ge=0, lt=10**9)]
    reach: tuple[Number, Number]
    regression: Annotated[RidgeLogistic, _is_for(FEATURES)]

    def covers(self, F_n: float, F_t: float) -> bool:
        """Return whether a load [N] and a traction [N] are among those learnt from."""
        return F_n <= self.reach[0] and F_t <= self.reach[1]


@dataclass(frozen=True, slots=True)
class ForesightModel:
    """Everything that foresight needs but the break-away models.

    Attributes:
        slip: None where too few slips were recorded.
        ground: of the terrains.
        provenance: of both.
    """

    slip: SlipModel | None
    ground: GroundModel
    provenance: Provenance

    @property
    def terrains(self) -> tuple[str, ...]:
        """Names of the known terrains, in the order of their probabilities."""
        return tuple(law.name for law in self.ground.laws)

    def knows(self, rig: RigIdentity) -> bool:
        """Return whether it was learnt with this foot on this rig."""
        return rig in self.provenance.rigs

    def to_dict(self) -> dict[str, Any]:
        """Return the model as plain values, for JSON."""
        return _ForesightFile.model_construct(
            version=VERSION,
            features=FEATURES,
            ground_features=GROUND_FEATURES,
            slip=self.slip,
            laws=self.ground.laws,
            surfaces=dict(self.ground.surfaces),
            provenance=self.provenance,
        ).model_dump(mode="json")

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> "ForesightModel":
        """Return the model of plain values; everything is checked.

        Raises:
            ValueError: a value is missing or not what it should be, or it is of
                another version.
        """
        file = _ForesightFile.model_validate(content)
        ground = GroundModel(file.laws, tuple(sorted(file.surfaces.items())))
        return cls(file.slip, ground, file.provenance)


class _ForesightFile(BaseModel):
    """Foresight as it is stored."""

    version: Literal[1]
    features: Many[str]
    ground_features: Many[str]
    slip: SlipModel | None
    laws: Annotated[Many[GroundLaw], Field(min_length=1, max_length=MOST_TERRAINS)]
    surfaces: Entries[int, Annotated[RidgeLogistic, _is_for(GROUND_FEATURES)]]
    provenance: Provenance

    @field_validator("features", "ground_features")
    @classmethod
    def _are_ours(cls, names: tuple[str, ...], info: ValidationInfo) -> tuple[str, ...]:
        ours = {"features": FEATURES, "ground_features": GROUND_FEATURES}
        if names != ours[info.field_name or ""]:
            raise ValueError("foresight was trained on other features")
        return names

    @field_validator("surfaces")
    @classmethod
    def _are_of_our_windows(
        cls, surfaces: dict[int, RidgeLogistic]
    ) -> dict[int, RidgeLogistic]:
        if not set(surfaces) <= set(WINDOWS):
            raise ValueError("foresight has other windows")
        return surfaces
