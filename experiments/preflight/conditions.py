"""Comparison of the present conditions with those of a session."""

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import BaseModel, TypeAdapter

from acquisition.errors import SessionError
from experiments.messages import CATALOGUE
from experiments.operator.console import GOOD, WARNING, Console
from experiments.operator.keys import KeyAction
from experiments.operator.prompts import OperatorInput, Prompt
from experiments.operator.terminal import wait_for_key
from experiments.preflight.page import CheckResult
from experiments.rig.rig import Rig
from experiments.session.recorded_conditions import read_conditions
from experiments.session.store import SessionFolder, list_sessions
from experiments.settings.matrix import TerrainRow
from experiments.settings.origins import flatten
from experiments.settings.rig import FootSection, RigSettings
from ft_sensor.vendors.registry import SECTIONS

FOOT = "terrain.foot"  # name of a condition
_GRAVITY, _FRICTION = "gravity calibration", "friction calibration"
_NO_CALIBRATION = "none"
_SENSOR = ("model", "serial_number", "firmware", "filter")
# Settings that do not affect recorded numbers.
_EXEMPT = (
    "rig.can.",
    "rig.loop.",
    "rig.operator.",
    "rig.limits.residual",
    "rig.arm.",
    "rig.ft_sensor.port",
    "rig.limits.free_disk_gb",
    "rig.places.",
    "terrain.trials",
    "terrain.simulate.",
    "terrain.reset",
)
_SHOWN = 8  # differences that are listed


def rig_conditions(rig: Rig) -> dict[str, str]:
    """Return settings, terrain row and digests of the calibrations by name."""
    values = _texts(
        {
            "rig": rig.settings.rig.model_dump(mode="json"),
            "terrain": rig.row.model_dump(mode="json"),
        }
    )
    texts = {_GRAVITY: rig.calibrations.gravity, _FRICTION: rig.calibrations.friction}
    digests = {name: _digest(text) for name, text in texts.items()}
    return {**values, **digests}


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest() if text else _NO_CALIBRATION


def sensor_conditions(devices: Mapping[str, str]) -> dict[str, str]:
    """Return the identity of the sensor from the metadata of the preflight."""
    return {
        f"sensor {key}": devices[f"ft_sensor:{key}"]
        for key in _SENSOR
        if f"ft_sensor:{key}" in devices
    }


def default_conditions(
    sensor_kind: str = "", feet: Iterable[str] = ()
) -> dict[str, str]:
    """Return the default conditions by name.

    A setting that a session does not state had its default value.

    Args:
        sensor_kind: `ft_sensor.kind`, which selects the section of the sensor.
        feet: names of the feet.
    """
    rig = _defaults(RigSettings)
    if sensor_kind in SECTIONS:
        rig["ft_sensor"] = _defaults(SECTIONS[sensor_kind])
    rig["feet"] = {name: _defaults(FootSection) for name in feet}
    defaults = {"rig": rig, "terrain": _defaults(TerrainRow)}
    none = dict.fromkeys((_GRAVITY, _FRICTION), _NO_CALIBRATION)
    return {**_texts(defaults), **none}


def differences(then: Mapping[str, str], now: Mapping[str, str]) -> list[str]:
    """Describe the conditions of `now` that differ from `then`.

    A condition missing in `then` had its default value. One missing in `now` is
    ignored: no setting can restore it.
    """
    feet = {n.split(".")[2] for n in now if n.startswith("rig.feet.")}
    kind = now.get("rig.ft_sensor.kind", "")
    before = {**default_conditions(kind, feet), **then}
    return [
        f"{name} was {before.get(name, 'not there')}, is {value}"
        for name, value in now.items()
        if before.get(name, "") != value
    ]


def check_conditions(
    folder: SessionFolder, now: Mapping[str, str], console: Console, *, is_forced: bool
) -> list[str]:
    """Compare `now` with the conditions of the session; returns the differences.

    Raises:
        SessionError: conditions differ, unless forced.
    """
    changed = differences(read_conditions(folder), now)
    for text in changed[:_SHOWN]:
        console.say(f"{WARNING} {text}")
    if len(changed) > _SHOWN:
        console.say(f"{WARNING} and {len(changed) - _SHOWN} more")
    if changed and not is_forced:
        count = (
            "1 condition is" if len(changed) == 1 else f"{len(changed)} conditions are"
        )
        raise SessionError(
            f"{count} not as in {folder.id}: {changed[0]}.",
            hint="Restore them, or add --force to record all the same. Nothing was "
            "recorded.",
        )
    return changed


def _texts(tables: Mapping[str, object]) -> dict[str, str]:
    """Return the values of tables as text by dotted name, without exempt names."""
    return {
        name: str(value)
        for name, value in flatten(tables).items()
        if not name.startswith(_EXEMPT)
    }


def _defaults(model: type[BaseModel]) -> dict[str, Any]:
    """Return the defaults of a model's fields, nested; required fields are left out."""
    defaults: dict[str, Any] = {}
    for name, field in model.model_fields.items():
        kind: Any = field.annotation
        if not field.is_required():
            value: Any = field.get_default(call_default_factory=True)
            defaults[name] = TypeAdapter[Any](kind).dump_python(value, mode="json")
        elif isinstance(kind, type) and issubclass(kind, BaseModel):
            defaults[name] = _defaults(kind)
    return defaults


@dataclass(frozen=True, slots=True)
class MountedFoot:
    """The foot of the last open session.

    Attributes:
        folder: folder of the session.
        foot: name of the foot in rig.toml.
    """

    folder: SessionFolder
    foot: str


def last_foot(data: Path, *, is_simulated: bool) -> MountedFoot | None:
    """Return the foot of the last open session, None before the first.

    Args:
        data: the data folder.
        is_simulated: kind of sessions to consider.
    """
    mounted: list[tuple[int, str, MountedFoot]] = []
    for folder in list_sessions(data):
        journal = folder.path / "events.jsonl"
        foot = read_conditions(folder).get(FOOT)
        if folder.is_simulated is is_simulated and foot and journal.is_file():
            order = journal.stat().st_mtime_ns, folder.path.name
            mounted.append((*order, MountedFoot(folder, foot)))
    return max(mounted, key=lambda entry: entry[:2])[2] if mounted else None


def confirm_foot(
    row: TerrainRow,
    before: MountedFoot | None,
    operator: OperatorInput,
    console: Console,
) -> CheckResult:
    """Return the line of the foot for the page; asks if the foot has changed.

    Raises:
        SessionError: the change was not confirmed.
    """
    if before is None or before.foot == row.foot:
        return CheckResult(GOOD, "foot", row.foot)
    session = before.folder.id
    message = CATALOGUE["foot-changed"]
    details = {"session": session, "before": before.foot, "terrain": row.name}
    details["foot"] = row.foot
    what = message.what.format_map(details)
    console.say(f"{WARNING} {what} {message.do.format_map(details)}")
    if wait_for_key(operator, Prompt.FOOT) is KeyAction.QUIT:
        raise SessionError(what, hint="Nothing was started.")
    text = f"{row.foot}, mounted since {session} ({before.foot}), as confirmed"
    return CheckResult(GOOD, "foot", text)
