"""Under which conditions a session was recorded, and whether they are the same now."""

import hashlib
from collections.abc import Mapping
from typing import cast

from acquisition.errors import SessionError
from experiments.operator.console import WARNING, Console
from experiments.rig.rig import Rig
from experiments.session.store import SessionFolder, read_json, write_json
from experiments.settings.origins import flatten

FILE = "conditions.json"
_SENSOR = ("model", "serial_number", "firmware", "filter")
# What no recorded number depends on.
_FREE = (
    "rig.can.",
    "rig.loop.",
    "rig.operator.",
    "rig.limits.residual",
    "rig.arm.mech_at_home",
    "rig.ft_sensor.port",
    "rig.limits.free_disk_gb",
    "terrain.trials",
    "terrain.reset",
)
_SHOWN = 8  # differences that are listed


def conditions_of(rig: Rig) -> dict[str, str]:
    """Return settings as calibrated, foot, terrain and gravity model by name."""
    named = {
        "rig": rig.settings.rig.model_dump(mode="json"),
        "terrain": rig.row.model_dump(mode="json"),
    }
    found = {
        name: str(value)
        for name, value in flatten(named).items()
        if not name.startswith(_FREE)
    }
    digest = hashlib.sha256(rig.gravity_text.encode()).hexdigest()
    return {**found, "gravity calibration": digest if rig.gravity_text else "none"}


def sensor_conditions(devices: Mapping[str, str]) -> dict[str, str]:
    """Return which sensor it is, from what the preflight found."""
    return {
        f"sensor {key}": devices[f"ft_sensor:{key}"]
        for key in _SENSOR
        if f"ft_sensor:{key}" in devices
    }


def write_conditions(folder: SessionFolder, found: Mapping[str, str]) -> None:
    """Keep the conditions of a new session.

    Raises:
        TrialFileError: the disk is full or gone.
    """
    write_json(folder.path / FILE, found)


def differences(then: Mapping[str, object], now: Mapping[str, str]) -> list[str]:
    """Return in words what is not as it was, of what is known now."""
    return [
        f"{name} was {then.get(name, 'not there')}, is {value}"
        for name, value in now.items()
        if str(then.get(name, "")) != value
    ]


def check_conditions(
    folder: SessionFolder, now: Mapping[str, str], console: Console, *, is_forced: bool
) -> list[str]:
    """Hold `now` against the conditions of the session; return what differs.

    Raises:
        SessionError: something differs and it is not forced.
    """
    then = cast("dict[str, object]", read_json(folder.path / FILE))
    found = differences(then, now)
    for text in found[:_SHOWN]:
        console.say(f"{WARNING} {text}")
    if len(found) > _SHOWN:
        console.say(f"{WARNING} and {len(found) - _SHOWN} more")
    if found and not is_forced:
        count = "1 condition is" if len(found) == 1 else f"{len(found)} conditions are"
        raise SessionError(
            f"{count} not as in {folder.id}: {found[0]}.",
            hint="Restore them, or add --force to record all the same. Nothing was "
            "recorded.",
        )
    return found
