"""Digests of the current inputs of the steps, by name in `order.STEP_INPUTS`.

A step whose inputs have changed since its record is stale.
"""

import hashlib
import json
import platform
from collections.abc import Mapping, Sequence
from typing import Any

from experiments.commissioning.evidence.order import StepId, input_names_of
from experiments.rig.rig import Rig
from experiments.settings.calibrations import PREFIX
from wam.driver.startup import ArmInfo

_PUCK = ("SN", "VERS", "ROLE", "CTS", "PIDX", "GRPA", "GRPB", "GRPC")
_MOTOR = ("IPNM", "POLES", "MT")
_SENSOR = ("model", "serial_number", "firmware")


def current_inputs(
    rig: Rig,
    puck_properties: Sequence[Mapping[str, int | None]] = (),
    info: ArmInfo | None = None,
    sensor: Mapping[str, str] | None = None,
) -> dict[str, str]:
    """Return the digests of all inputs that are currently known.

    Args:
        rig: the rig with its settings and calibrations.
        puck_properties: properties of pucks 1 to 7; () = not read.
        info: result of the arm's start-up; None = not started.
        sensor: identity of the wrist sensor; None = not opened.
    """
    section = rig.settings.rig
    arm = section.arm.model_dump(mode="json")
    zero = arm.pop("mech_at_home")
    texts, feet = rig.settings.calibrations, section.feet
    parts = (section.ft_sensor, *feet.values())
    sensor_calibration, *foot_calibrations = (
        texts.get(f"{PREFIX}{part.calibration}", "") for part in parts
    )
    content: dict[str, Any] = {
        "zero": zero,
        "[safety]": section.safety.model_dump(mode="json"),
        "[limits]": section.limits.model_dump(mode="json"),
        "[arm]": arm,
        "[feet]": [
            {name: foot.plain() for name, foot in feet.items()},
            foot_calibrations,
        ],
        "[ft_sensor]": [section.ft_sensor.model_dump(mode="json"), sensor_calibration],
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
    if puck_properties:
        content["pucks"] = _properties(puck_properties, _PUCK)
        content["motors"] = _properties(puck_properties, _MOTOR)
    if info is not None and (module := info.module_identity()):
        content["module"] = module
    if sensor is not None and not _is_unknown(sensor, "serial_number"):
        content["sensor"] = [
            "" if _is_unknown(sensor, name) else sensor[name] for name in _SENSOR
        ]
    return {name: _digest(part) for name, part in content.items()}


def inputs_of(step: StepId, current: Mapping[str, str]) -> dict[str, str]:
    """Return the current digests of the inputs of a step."""
    return {name: current[name] for name in input_names_of(step) if name in current}


def _properties(
    puck_properties: Sequence[Mapping[str, int | None]], names: Sequence[str]
) -> list[list[int | None]]:
    return [[puck.get(name) for name in names] for puck in puck_properties]


def _is_unknown(sensor: Mapping[str, str], name: str) -> bool:
    """Return whether the sensor does not report this property."""
    return sensor.get(name, "unknown").startswith("unknown")


def _digest(content: object) -> str:
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()
