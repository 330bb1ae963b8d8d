"""Present inputs of the steps: digests by the names of `order.BASES`."""

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
    """Return the digests of all inputs known now.

    Args:
        rig: the rig with its settings and calibrations.
        answers: properties of pucks 1 to 7; () = not read.
        info: result of the start; None = not started.
        sensor: identity of the wrist sensor; None = not opened.
    """
    section = rig.settings.rig
    arm = section.arm.model_dump(mode="json")
    zero = arm.pop("mech_at_home")
    texts, feet = rig.settings.calibrations, section.feet
    parts = (section.ft_sensor, *feet.values())
    of_sensor, *of_feet = (
        texts.get(f"{PREFIX}{part.calibration}", "") for part in parts
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
    return {name: _digest(part) for name, part in content.items()}


def inputs_of(step: StepId, present: Mapping[str, str]) -> dict[str, str]:
    """Return the present digests of the inputs of a step."""
    return {name: present[name] for name in bases_of(step) if name in present}


def _properties(
    answers: Sequence[Mapping[str, int | None]], names: Sequence[str]
) -> list[list[int | None]]:
    return [[answer.get(name) for name in names] for answer in answers]


def _is_unknown(sensor: Mapping[str, str], name: str) -> bool:
    """Return whether a sensor does not report a property, or not always."""
    return sensor.get(name, "unknown").startswith("unknown")


def _digest(content: object) -> str:
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()
