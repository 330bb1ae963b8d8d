"""What the steps stand on, as it is now: digests by the names of `order.BASES`."""

import hashlib
import json
import platform
from collections.abc import Mapping, Sequence
from typing import Any

from experiments.commissioning.evidence.order import StepId, bases_of
from experiments.rig.rig import Rig
from experiments.settings.calibrations import PREFIX
from wam.driver.startup import ArmInfo

_PUCK = ("SN", "VERS", "ROLE", "CTS", "PIDX", "GRPA", "GRPB", "GRPC")
_MOTOR = ("IPNM", "POLES", "MT")
_SENSOR = ("model", "serial_number", "firmware")


def present_inputs(
    rig: Rig,
    answers: Sequence[Mapping[str, int | None]] = (),
    info: ArmInfo | None = None,
    sensor: Mapping[str, str] | None = None,
) -> dict[str, str]:
    """Return the digest of everything that is known.

    Args:
        rig: with its settings and calibrations.
        answers: what pucks 1 to 7 said of themselves; () = they were not asked.
        info: of the start; None = it was not started.
        sensor: what the wrist sensor says of itself; None = it was not opened.
    """
    section = rig.settings.rig
    arm = section.arm.model_dump(mode="json")
    zero = arm.pop("mech_at_home")
    texts, feet = rig.settings.calibrations, section.feet
    names = (section.ft_sensor, *feet.values())
    of_sensor, *of_feet = (
        texts.get(f"{PREFIX}{each.calibration}", "") for each in names
    )
    content: dict[str, Any] = {
        "zero": zero,
        "[safety]": section.safety.model_dump(mode="json"),
        "[limits]": section.limits.model_dump(mode="json"),
        "[arm]": arm,
        "[feet]": [{name: foot.plain() for name, foot in feet.items()}, of_feet],
        "[ft_sensor]": [section.ft_sensor.model_dump(mode="json"), of_sensor],
        "[gravity]": [
            section.gravity.model_dump(mode="json"),
            rig.calibrations.gravity,
        ],
        "[friction]": [
            section.friction.model_dump(mode="json"),
            rig.calibrations.friction,
        ],
        "[control]": section.control.model_dump(mode="json"),
        "[can]": [section.can.model_dump(mode="json"), platform.release()],
        "terrain": [
            rig.row.plain(),
            texts.get(f"{PREFIX}{rig.row.calibration}", ""),
        ],
    }
    if answers:
        content["pucks"] = _properties(answers, _PUCK)
        content["motors"] = _properties(answers, _MOTOR)
    if info is not None and (module := info.module_identity()):
        content["module"] = module
    if sensor is not None and not _is_unknown(sensor, "serial_number"):
        content["sensor"] = [
            "" if _is_unknown(sensor, name) else sensor[name] for name in _SENSOR
        ]
    return {name: _digest(each) for name, each in content.items()}


def inputs_of(step: StepId, present: Mapping[str, str]) -> dict[str, str]:
    """Return of the present digests those that a step stands on."""
    return {name: present[name] for name in bases_of(step) if name in present}


def _properties(
    answers: Sequence[Mapping[str, int | None]], names: Sequence[str]
) -> list[list[int | None]]:
    return [[answer.get(name) for name in names] for answer in answers]


def _is_unknown(sensor: Mapping[str, str], name: str) -> bool:
    """Return whether a sensor does not tell this of itself, or not every time."""
    return sensor.get(name, "unknown").startswith("unknown")


def _digest(content: object) -> str:
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()
