"""What foresight has learnt, and on which rig: plain values in and out."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any

from acquisition.schema import MOST_TERRAINS
from analysis.foresight.ground import SHARES, GroundLaw, GroundModel
from analysis.foresight.ground_window import GROUND_FEATURES, WINDOWS
from analysis.foresight.logistic import RidgeLogistic
from analysis.foresight.signals import FEATURES

VERSION = 1
_LARGEST = 1e6  # of a number in a law
_MOST_RIGS, _MOST_NAMES, _LONGEST = 100, 5000, 200


@dataclass(frozen=True, slots=True)
class RigIdentity:
    """What a trial states of foot and rig, as text.

    Attributes:
        simulated: "true" or "false".
        tread: whether the foot has its tread on, "true" or "false".
        effective_mass_kg: of the arm at the sole.
        foot_mass_kg: of the foot.
    """

    simulated: str
    tread: str
    effective_mass_kg: str
    foot_mass_kg: str

    @classmethod
    def of(cls, trial: Mapping[str, str]) -> "RigIdentity":
        """Return the identity in a trial's metadata; "" for what is not stated."""
        return cls(*(str(trial.get(name, "")) for name in cls.__slots__))

    def to_dict(self) -> dict[str, str]:
        """Return it as a mapping, as in a trial's metadata."""
        return {name: str(getattr(self, name)) for name in RigIdentity.__slots__}

    @property
    def text(self) -> str:
        """The identity in words."""
        foot = {"true": "tread", "false": "bare"}.get(self.tread, "?")
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

    rigs: tuple[RigIdentity, ...]
    trials: tuple[str, ...]
    seeds: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class SlipModel:
    """Probability of a slip within 200 ms.

    Attributes:
        regression: on the features of `signals`.
        threshold: probability at which an alarm begins, set on trials that the
            regression of their fold had not seen.
        slips: number of slips that it was learnt from.
        reach: F_n and F_t [N] beyond which nothing was learnt.
    """

    regression: RidgeLogistic
    threshold: float
    slips: int
    reach: tuple[float, float]

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
        source = self.provenance
        return {
            "version": VERSION,
            "features": list(FEATURES),
            "ground_features": list(GROUND_FEATURES),
            "slip": None if self.slip is None else _plain_slip(self.slip),
            "laws": [_plain_law(law) for law in self.ground.laws],
            "surfaces": {str(n): one.to_dict() for n, one in self.ground.surfaces},
            "provenance": {
                "rigs": [rig.to_dict() for rig in source.rigs],
                "trials": list(source.trials),
                "seeds": list(source.seeds),
            },
        }

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> "ForesightModel":
        """Return the model of plain values; everything is checked.

        Raises:
            ValueError: a value is not what it should be, or of another version.
            TypeError: one is of another type.
            KeyError: one is missing.
        """
        if content["version"] != VERSION:
            raise ValueError(f"foresight of version {content['version']!r}"[:60])
        names = (tuple(content["features"]), tuple(content["ground_features"]))
        if names != (FEATURES, GROUND_FEATURES):
            raise ValueError("foresight was trained on other features")
        slip = content["slip"]
        laws = tuple(_law(dict(one)) for one in content["laws"])
        if not 0 < len(laws) <= MOST_TERRAINS:
            raise ValueError(f"foresight of {len(laws)} terrains")
        count = len(GROUND_FEATURES)
        surfaces = {
            int(size): RidgeLogistic.from_dict(dict(one), count)
            for size, one in dict(content["surfaces"]).items()
        }
        if not set(surfaces) <= set(WINDOWS):
            raise ValueError("foresight has other windows")
        return cls(
            slip=None if slip is None else _slip(dict(slip)),
            ground=GroundModel(laws, tuple(sorted(surfaces.items()))),
            provenance=_provenance(dict(content["provenance"])),
        )


def _plain_slip(slip: SlipModel) -> dict[str, Any]:
    regression = slip.regression.to_dict()
    return {
        "threshold": slip.threshold,
        "slips": slip.slips,
        "reach": list(slip.reach),
        "regression": regression,
    }


def _slip(content: Mapping[str, Any]) -> SlipModel:
    threshold, slips = float(content["threshold"]), int(content["slips"])
    if not 0.0 < threshold < 1.0 or not 0 <= slips < 10**9:
        raise ValueError("a threshold is not between 0 and 1")
    regression = RidgeLogistic.from_dict(dict(content["regression"]), len(FEATURES))
    most_load, most_force = _numbers(content["reach"], 2)
    return SlipModel(regression, threshold, slips, (most_load, most_force))


def _plain_law(law: GroundLaw) -> dict[str, Any]:
    return {
        "name": law.name,
        "surface": law.surface,
        "mean": list(law.mean),
        "log_sd": list(law.log_sd),
        "loads": list(law.loads),
        "densities": list(law.densities),
    }


def _law(content: Mapping[str, Any]) -> GroundLaw:
    low, high = _numbers(content["loads"], 2)
    densities = _numbers(content["densities"], len(SHARES))
    if low > high or list(densities) != sorted(densities):
        raise ValueError("loads or densities of a terrain do not increase")
    log_sd = _numbers(content["log_sd"], 3)
    if max(map(abs, log_sd)) > 100.0:
        raise ValueError("a spread of a terrain is impossible")
    return GroundLaw(
        name=_word(content["name"]),
        surface=_word(content["surface"]),
        mean=_numbers(content["mean"], 6),
        log_sd=log_sd,
        loads=(low, high),
        densities=densities,
    )


def _provenance(content: Mapping[str, Any]) -> Provenance:
    rigs, trials, seeds = content["rigs"], content["trials"], content["seeds"]
    if len(rigs) > _MOST_RIGS or max(len(trials), len(seeds)) > _MOST_NAMES:
        raise ValueError("foresight names too many rigs or trials")
    identities = [
        RigIdentity.of({str(k): _word(v) for k, v in dict(rig).items()}) for rig in rigs
    ]
    return Provenance(
        tuple(identities), tuple(map(_word, trials)), tuple(map(_word, seeds))
    )


def _numbers(values: Sequence[Any], count: int) -> tuple[float, ...]:
    numbers = tuple(map(float, values))
    if len(numbers) != count or not all(
        isfinite(n) and abs(n) <= _LARGEST for n in numbers
    ):
        raise ValueError(f"a law of a terrain is not {count} numbers")
    return numbers


def _word(value: object) -> str:
    if not isinstance(value, str) or len(value) > _LONGEST or not value.isprintable():
        raise ValueError("a name of foresight is not a short text")
    return value
