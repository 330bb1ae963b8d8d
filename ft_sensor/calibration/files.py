"""Payload calibration and terrain as TOML, attached to every recording."""

from collections.abc import Mapping
from typing import Any, TypeVar

import numpy as np
from pydantic import Field

from acquisition.errors import SettingsError
from acquisition.settings import Number, Six
from acquisition.toml_files import TomlFile, TomlTable
from ft_sensor.payload import Payload, TerrainFrame
from wam.model.constants import Array

_F = TypeVar("_F", bound=TomlFile)
_Vector = tuple[Number, Number, Number]


class _PayloadTable(TomlTable):
    mass: Number
    com: _Vector
    rotation: tuple[_Vector, _Vector, _Vector]
    sign: Number
    bias: Six


class _FootTable(TomlTable):
    sole: _Vector


class _PayloadFile(TomlFile):
    payload: _PayloadTable
    foot: _FootTable


class _TerrainFile(TomlFile):
    name: str
    incline: Number
    heading: Number
    far_end: _Vector
    travel: Number
    facts: dict[str, Any] = Field(default_factory=dict[str, Any])


def payload_to_toml(payload: Payload, sole: Array) -> str:
    """Return `ft_calibration.toml`: payload, mounting, bias, and the sole's centre."""
    table = _PayloadTable.model_construct(
        mass=float(payload.mass),
        com=payload.com.tolist(),
        rotation=payload.rotation.tolist(),
        sign=float(payload.sign),
        bias=payload.bias.tolist(),
    )
    foot = _FootTable.model_construct(sole=sole.tolist())
    file = _PayloadFile.model_construct(payload=table, foot=foot)
    return file.text("SI units. sole and rotation refer to frame 7 (tool plate).")


def payload_from_toml(text: str) -> tuple[Payload, Array]:
    """Return (payload, sole [m] (3,)) from `ft_calibration.toml`.

    Raises:
        SettingsError: the text is not a valid file.
    """
    file = _parse(_PayloadFile, text, "ft_calibration.toml")
    payload = Payload(
        mass=file.payload.mass,
        com=np.array(file.payload.com),
        rotation=np.array(file.payload.rotation),
        sign=file.payload.sign,
        bias=np.array(file.payload.bias),
    )
    return payload, np.array(file.foot.sole)


def terrain_to_toml(name: str, frame: TerrainFrame, fields: Mapping[str, str]) -> str:
    """Return `terrain.toml`: pose of the container and facts about its bed."""
    file = _TerrainFile.model_construct(
        name=name,
        incline=float(frame.incline),
        heading=float(frame.heading),
        far_end=[float(value) for value in frame.start],
        travel=float(frame.travel),
        facts=fields,
    )
    return file.text("SI units, angles in rad, base frame of the arm.")


def terrain_from_toml(text: str) -> tuple[str, TerrainFrame]:
    """Return (name, frame) from `terrain.toml`.

    Raises:
        SettingsError: the text is not a valid file.
    """
    file = _parse(_TerrainFile, text, "terrain.toml")
    frame = TerrainFrame(file.incline, file.heading, file.far_end, file.travel)
    return file.name, frame


def terrain_metadata(text: str) -> dict[str, str]:
    """Return the table `facts` of `terrain.toml`, empty if there is none.

    Raises:
        SettingsError: the text is not a valid file.
    """
    facts = _parse(_TerrainFile, text, "terrain.toml").facts
    return {key: str(value) for key, value in facts.items()}


def _parse(kind: type[_F], text: str, name: str) -> _F:
    try:
        return kind.parse(text)
    except ValueError as error:
        raise SettingsError(f"{name} is incomplete: {error}.") from error
