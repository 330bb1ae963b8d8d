"""Recording of a step: named arrays in one compressed file, without pickle."""

import hashlib
import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from acquisition.errors import SettingsError
from acquisition.files import read_regular
from experiments.commissioning.evidence.record import Raw

_LARGEST = 64_000_000  # bytes of a file
Values: TypeAlias = Mapping[str, NDArray[Any]]


def words(values: Values, name: str) -> list[str]:
    """Return an array of texts as a list."""
    return [str(text) for text in values[name].tolist()]


def number(values: Values, name: str) -> float:
    """Return a single number."""
    return float(values[name])


def texts(lines: list[str]) -> NDArray[np.str_]:
    """Return a list of texts as an array, also an empty one."""
    return np.array(lines, dtype=np.str_)


def write_raw(folder: Path, name: str, values: Values) -> Raw:
    """Write a recording to the folder of commissioning.json; returns its entry.

    Raises:
        OSError: the file cannot be written.
    """
    buffer = io.BytesIO()
    np.savez_compressed(buffer, allow_pickle=False, **dict(values))
    data = buffer.getvalue()
    (folder / name).write_bytes(data)
    return Raw(file=name, sha256=hashlib.sha256(data).hexdigest())


def read_raw(folder: Path, raw: Raw) -> dict[str, NDArray[Any]]:
    """Read a recording and verify its checksum.

    Raises:
        SettingsError: the file is missing or was changed.
    """
    path = folder / raw.file
    try:
        data = read_regular(path, _LARGEST)
    except OSError as error:
        raise SettingsError(
            f"{path} cannot be read: {error.strerror or error}.",
            hint="Put the recording back, or do its step again.",
        ) from error
    if hashlib.sha256(data).hexdigest() != raw.sha256:
        raise SettingsError(
            f"{path} is not what was recorded: its digest is another one.",
            hint="Put the recording back, or do its step again.",
        )
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as file:
            return {name: file[name] for name in file.files}
    except (ValueError, OSError, EOFError) as error:
        raise SettingsError(
            f"{path} is no recording: {error}.", hint="Do its step again."
        ) from error
