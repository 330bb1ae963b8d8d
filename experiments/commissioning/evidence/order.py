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
class StepInput:
    """An input of commissioning steps.

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
STEP_INPUTS: dict[str, StepInput] = {
    "pucks": StepInput(
        "serial number, firmware, role, counts, slot or groups of a motor puck",
        (_S.IDENTITY, *_from(_S.BY_HAND)),
    ),
    "motors": StepInput(
        "torque units, poles or largest torque of a motor puck",
        (_S.IDENTITY, *_from(_S.REST_POSE, _S.LOCK_AND_CLOCK)),
    ),
    "module": StepInput(
        "serial number, firmware or defaults of the safety module",
        (_S.IDENTITY, _S.STOP_CIRCUIT),
    ),
    "zero": StepInput(
        "zero position of the joints",
        (_S.BY_HAND, _S.OWN_WEIGHT, _S.HUNG_WEIGHT, _S.CONTAINER),
    ),
    "[safety]": StepInput(
        "[safety] of rig.toml", (_S.CONFIGURATION, _S.IDENTITY, _S.STOP_CIRCUIT)
    ),
    "[limits]": StepInput("[limits] of rig.toml", (_S.CONFIGURATION, _S.GRAVITY_RAMP)),
    "[arm]": StepInput("[arm] of rig.toml", (_S.CONFIGURATION, _S.BY_HAND)),
    "[feet]": StepInput(
        "the foot of rig.toml or its calibration",
        (_S.OWN_WEIGHT, _S.HUNG_WEIGHT, *_from(_S.RAMPS, _S.GRAVITY_RAMP)),
    ),
    "[ft_sensor]": StepInput(
        "[ft_sensor] of rig.toml or its calibration",
        (_S.OWN_WEIGHT, _S.HUNG_WEIGHT, _S.LOCK_AND_CLOCK, _S.PLATE),
    ),
    "sensor": StepInput(
        "kind, serial number or firmware of the wrist sensor",
        (_S.OWN_WEIGHT, _S.HUNG_WEIGHT, _S.LOCK_AND_CLOCK, _S.PLATE),
        is_optional=True,
    ),
    "[gravity]": StepInput(
        "[gravity] of rig.toml or its calibration", (_S.LIFT, _S.GRAVITY_RAMP)
    ),
    "[friction]": StepInput(
        "[friction] of rig.toml or its calibration", (_S.LIFT, _S.GRAVITY_RAMP)
    ),
    "[control]": StepInput(
        "[control] of rig.toml", (_S.GRAVITY_RAMP, _S.LOCK_AND_CLOCK)
    ),
    "[can]": StepInput(
        "[can] of rig.toml, the adapter or the Linux kernel", (_S.LISTEN, _S.TIMING)
    ),
    "terrain": StepInput("row of the terrain or its calibration", (_S.CONTAINER,)),
    "mounting": StepInput("where the arm stands", ORDER),
    "cables": StepInput(
        "tension of the drive cables",
        _from(_S.BY_HAND, _S.GRAVITY_RAMP),
    ),
}
REPORTED_INPUTS = ("mounting", "cables")  # inputs that only a person can report
LONGEST_DAYS = 30  # validity of a step


def input_names_of(step: StepId) -> list[str]:
    """Return the names of the inputs of a step."""
    return [name for name, given in STEP_INPUTS.items() if step in given.steps]
