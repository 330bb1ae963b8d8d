"""Calibration and terrain as TOML: what a recording needs to be read years later."""

import json
from collections.abc import Mapping
from typing import Any, cast

import numpy as np

from acquisition.errors import SettingsError
from acquisition.settings import parse_toml
from ft_sensor.payload import Payload, TerrainFrame
from wam.model.constants import Array


def payload_to_toml(payload: Payload, sole: Array) -> str:
    """Return `ft_calibration.toml`: payload, mounting, bias, and the sole's centre."""
    return (
        "# SI units. sole and rotation refer to frame 7 (tool plate).\n"
        "[payload]\n"
        f"mass = {float(payload.mass)!r}\n"
        f"com = {payload.com.tolist()}\n"
        f"rotation = {payload.rotation.tolist()}\n"
        f"sign = {float(payload.sign)!r}\n"
        f"bias = {payload.bias.tolist()}\n"
        "\n[foot]\n"
        f"sole = {sole.tolist()}\n"
    )


def payload_from_toml(text: str) -> tuple[Payload, Array]:
    """Return (payload, sole [m] (3,)) from `ft_calibration.toml`.

    Raises:
        SettingsError: the text is not of that form.
    """
    table = _parse(text, "ft_calibration.toml")
    try:
        section = table["payload"]
        payload = Payload(
            mass=_number(section["mass"]),
            com=_array(section["com"], (3,)),
            rotation=_array(section["rotation"], (3, 3)),
            sign=_number(section["sign"]),
            bias=_array(section["bias"], (6,)),
        )
        return payload, _array(table["foot"]["sole"], (3,))
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise SettingsError(f"ft_calibration.toml is incomplete: {error}.") from error


def terrain_to_toml(name: str, frame: TerrainFrame, fields: Mapping[str, str]) -> str:
    """Return `terrain.toml`: where the container stood and what was in it."""
    extra = "".join(f"{key} = {_quoted(value)}\n" for key, value in fields.items())
    return (
        "# SI units, angles in rad, base frame of the arm.\n"
        f"name = {_quoted(name)}\n"
        f"incline = {float(frame.incline)!r}\n"
        f"heading = {float(frame.heading)!r}\n"
        f"far_end = {[float(value) for value in frame.far_end]}\n"
        f"travel = {float(frame.travel)!r}\n"
        "\n[facts]\n" + extra
    )


def terrain_from_toml(text: str) -> tuple[str, TerrainFrame]:
    """Return (name, frame) from `terrain.toml`.

    Raises:
        SettingsError: the text is not of that form.
    """
    table = _parse(text, "terrain.toml")
    try:
        x, y, z = _array(table["far_end"], (3,)).tolist()
        frame = TerrainFrame(
            incline=_number(table["incline"]),
            heading=_number(table["heading"]),
            far_end=(x, y, z),
            travel=_number(table["travel"]),
        )
        return str(table["name"]), frame
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise SettingsError(f"terrain.toml is incomplete: {error}.") from error


def terrain_metadata(text: str) -> dict[str, str]:
    """Return what else `terrain.toml` says, empty where it says nothing.

    Raises:
        SettingsError: the text is no TOML, or says it in another form.
    """
    table: object = _parse(text, "terrain.toml").get("facts", {})
    if not isinstance(table, dict):
        raise SettingsError("terrain.toml is incomplete: facts is not a table.")
    fields = cast("dict[str, object]", table)
    return {str(key): str(value) for key, value in fields.items()}


def _parse(text: str, name: str) -> dict[str, Any]:
    try:
        return parse_toml(text)
    except ValueError as error:
        raise SettingsError(f"{name}: {error}.") from error


def _number(value: object) -> float:
    return float(_array(value, ()))


def _array(value: object, shape: tuple[int, ...]) -> Array:
    array = np.array(value, dtype=float)
    if array.shape != shape or not bool(np.isfinite(array).all()):
        raise ValueError(f"expected {shape} finite numbers, got {value!r:.80}")
    return array


def _quoted(text: str) -> str:
    # JSON escapes what TOML does, but for one character.
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
