"""The steps of a commissioning in their order, and the inputs that make them stale.

Each step verifies what later ones rely on, with the least energy. A passed step is
repeated only if one of its inputs has changed.
"""

from dataclasses import dataclass
from enum import StrEnum


class StepId(StrEnum):
    """A step by its number, in order of execution."""

    CONFIGURATION = "C0"
    LISTEN = "C1"
    IDENTITY = "C2"
    TIMING = "C3"
    STOP_CIRCUIT = "C4"
    BY_HAND = "C5"
    OWN_WEIGHT = "C6"
    HUNG_WEIGHT = "C7"
    REST_POSE = "C8"
    RAMPS = "C9"
    LIFT = "C10"
    GRAVITY_RAMP = "C11"
    LOCK_AND_CLOCK = "C12"
    CONTAINER = "C13"
    PLATE = "C14"

    @property
    def words(self) -> str:
        """Name of the step as words."""
        return self.name.replace("_", " ").lower()


ORDER = tuple(StepId)
# Steps required before torque is sent to a real arm.
GATED = ORDER[: ORDER.index(StepId.GRAVITY_RAMP) + 1]


def _from(first: StepId, last: StepId = StepId.PLATE) -> tuple[StepId, ...]:
    return ORDER[ORDER.index(first) : ORDER.index(last) + 1]


@dataclass(frozen=True, slots=True)
class Basis:
    """An input of steps.

    Attributes:
        words: description.
        steps: steps that a change makes stale.
        is_optional: whether a device does not always report it: a step recorded
            without it is no contradiction.
    """

    words: str
    steps: tuple[StepId, ...]
    is_optional: bool = False


_S = StepId
BASES: dict[str, Basis] = {
    "pucks": Basis(
        "serial number, firmware, role, counts, slot or groups of a motor puck",
        (_S.IDENTITY, *_from(_S.BY_HAND)),
    ),
    "motors": Basis(
        "torque units, poles or largest torque of a motor puck",
        (_S.IDENTITY, *_from(_S.REST_POSE, _S.LOCK_AND_CLOCK)),
    ),
    "module": Basis(
        "serial number, firmware or defaults of the safety module",
        (_S.IDENTITY, _S.STOP_CIRCUIT),
    ),
    "zero": Basis(
        "zero position of the joints",
        (_S.BY_HAND, _S.OWN_WEIGHT, _S.HUNG_WEIGHT, _S.CONTAINER),
    ),
    "[safety]": Basis(
        "[safety] of rig.toml", (_S.CONFIGURATION, _S.IDENTITY, _S.STOP_CIRCUIT)
    ),
    "[limits]": Basis("[limits] of rig.toml", (_S.CONFIGURATION, _S.GRAVITY_RAMP)),
    "[arm]": Basis("[arm] of rig.toml", (_S.CONFIGURATION, _S.BY_HAND)),
    "[feet]": Basis(
        "the foot of rig.toml or its calibration",
        (_S.OWN_WEIGHT, _S.HUNG_WEIGHT, *_from(_S.RAMPS, _S.GRAVITY_RAMP)),
    ),
    "[ft_sensor]": Basis(
        "[ft_sensor] of rig.toml or its calibration",
        (_S.OWN_WEIGHT, _S.HUNG_WEIGHT, _S.LOCK_AND_CLOCK, _S.PLATE),
    ),
    "sensor": Basis(
        "kind, serial number or firmware of the wrist sensor",
        (_S.OWN_WEIGHT, _S.HUNG_WEIGHT, _S.LOCK_AND_CLOCK, _S.PLATE),
        is_optional=True,
    ),
    "[gravity]": Basis(
        "[gravity] of rig.toml or its calibration", (_S.LIFT, _S.GRAVITY_RAMP)
    ),
    "[friction]": Basis(
        "[friction] of rig.toml or its calibration", (_S.LIFT, _S.GRAVITY_RAMP)
    ),
    "[control]": Basis("[control] of rig.toml", (_S.GRAVITY_RAMP, _S.LOCK_AND_CLOCK)),
    "[can]": Basis(
        "[can] of rig.toml, the adapter or the kernel", (_S.LISTEN, _S.TIMING)
    ),
    "terrain": Basis("row of the terrain or its calibration", (_S.CONTAINER,)),
    "mounting": Basis("where the arm stands", ORDER),
    "cables": Basis(
        "tension of the drive cables",
        _from(_S.BY_HAND, _S.GRAVITY_RAMP),
    ),
}
REPORTED_BASES = ("mounting", "cables")  # bases that only a person can report
LONGEST_DAYS = 30  # validity of a step


def bases_of(step: StepId) -> list[str]:
    """Return the names of the inputs of a step."""
    return [name for name, basis in BASES.items() if step in basis.steps]
