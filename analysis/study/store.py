"""Results of a study on disk, by the hash of what they were made from.

An interrupted study resumes where it stopped, and a study repeated with one choice
changed repeats only what that choice touches. A result is known by its task and by the
code that computes it, so a corrected formula never shows an old number. A file that is
damaged or foreign counts as not there. Files are written whole or not at all.

Values become JSON and come back exactly: dataclasses, named tuples, enumerations,
arrays, numbers. Nothing is ever unpickled: a type is found by name in a table of the
types that may appear, and its fields must be exactly its own.

The folder has a size: beyond `MOST_BYTES` the results that were used longest ago go,
down to nine tenths of it. A result that is read counts as used.
"""

import base64
import contextlib
import hashlib
import json
import math
import os
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.errors import SettingsError
from acquisition.files import open_directory, read_regular, replace_file
from analysis.data.samples import SampleTable
from analysis.gp import noise, trial_noise
from analysis.gp.kernels import KERNELS
from analysis.gp.regression import GaussianProcess
from analysis.gp.search import Start
from analysis.study.crossval import FoldResult, ModelFold
from analysis.study.digests import code_digest, value_digest
from analysis.study.metrics import Score
from analysis.study.models import GpModel, TustinModel
from analysis.study.new_trial import NewTrialModel
from analysis.study.noise_selection import NoiseChoice, TailedNoise
from analysis.study.slip_risk import BreakAwayModel, PushLaw
from analysis.study.terrain_fit import PooledTustinFit
from analysis.study.trial_components import TrialComponents
from analysis.tustin import model as tustin
from analysis.tustin.identifiability import Interval, Profiles

Types = Mapping[str, type]
Function = Callable[..., Any]

_DTYPES = {"float64": "<f8", "int64": "<i8", "bool": "|b1"}
MOST_BYTES = 256 * 1024**2  # of all results, at least; a fold has about 60 kB
LARGEST = 16 * 1024**2  # bytes of one result; a larger file is none
_KEPT = 0.9  # share of the size that is left when results go

TYPES = KERNELS | {
    kind.__name__: kind
    for kind in (
        BreakAwayModel,
        FoldResult,
        GaussianProcess,
        GpModel,
        Interval,
        ModelFold,
        NewTrialModel,
        NoiseChoice,
        PooledTustinFit,
        Profiles,
        PushLaw,
        SampleTable,
        Score,
        Start,
        TailedNoise,
        TrialComponents,
        TustinModel,
        noise.ConstantNoise,
        noise.LogLinearNoise,
        trial_noise.TrialNoise,
        trial_noise.TrialRows,
        tustin.TustinBounds,
        tustin.TustinFit,
        tustin.TustinForm,
        tustin.TustinParameters,
    )
}


class ResultStore:
    """Keeps one file per task below a folder.

    Args:
        folder: made when the first result is kept; may be deleted at any time.
        most: bytes that its results may have together.
        types: every type that may appear in a result, by name.
    """

    def __init__(
        self, folder: Path, most: int = MOST_BYTES, types: Types = TYPES
    ) -> None:
        self._folder = folder
        self._most = most
        self._types = types
        self._bytes: int | None = None  # of the folder, as far as it is known

    def get(self, function: Function, task: Any) -> Any | None:  # noqa: ANN401
        """Return the result of a task done before, None if there is none."""
        path = self._path(function, task)
        try:
            content = json.loads(read_regular(path, LARGEST))
            is_whole = content["digest"] == _digest(content["result"])
            result = decode(content["result"], self._types) if is_whole else None
        except (OSError, ValueError, KeyError, TypeError, RecursionError):
            return None
        with contextlib.suppress(OSError):  # a folder that is only read from
            os.utime(path)
        return result

    def put(self, function: Function, task: Any, result: Any) -> None:  # noqa: ANN401
        """Keep a result.

        Raises:
            SettingsError: the folder cannot be written.
            TypeError: a type in it is not in the table, so it could never be read.
        """
        plain = encode(result)
        if unknown := sorted(_type_names(plain) - set(self._types)):
            raise TypeError(f"results with {', '.join(unknown)} cannot be read again")
        content = {"digest": _digest(plain), "result": plain}
        path, data = self._path(function, task), json.dumps(content).encode()
        if path.is_dir():  # nobody's result; it is made again every time
            return
        write_atomic(path, data)
        if self._bytes is not None:
            self._bytes += len(data)
        if self._bytes is None or self._bytes > self._most:
            self._bytes = remove_oldest(self._folder, self._most)

    def _path(self, function: Function, task: Any) -> Path:  # noqa: ANN401
        return self._folder / f"{task_key(function, task)}.json"


def remove_oldest(folder: Path, most: int) -> int:
    """Remove what was used longest ago if all results together exceed `most` bytes.

    What other processes remove meanwhile is no error. Returns the bytes that are left.
    """
    files: list[tuple[int, int, Path]] = []
    for path in (*folder.glob("*.json"), *folder.glob(".*.json.*")):
        with contextlib.suppress(OSError):
            found = path.lstat()
            files.append((found.st_mtime_ns, found.st_size, path))
    total = sum(size for _, size, _ in files)
    if total <= most:
        return total
    for _, size, path in sorted(files):
        if total <= _KEPT * most:
            break
        with contextlib.suppress(OSError):
            path.unlink()
            total -= size
    return total


def task_key(function: Function, task: Any) -> str:  # noqa: ANN401
    """Return the hash of a task: its data, its options, and the code it is done by."""
    name, code = function.__qualname__, code_digest(function.__module__)
    return _digest({"function": name, "code": code, "task": value_digest(task)})


def _type_names(plain: Any) -> set[str]:  # noqa: ANN401
    """Return the names of all types in what `encode` made."""
    if isinstance(plain, list):
        return set().union(*map(_type_names, plain))
    if not isinstance(plain, dict):
        return set()
    inside = set().union(*map(_type_names, plain.values()))
    return inside | ({plain["type"]} if "type" in plain and len(plain) > 1 else set())


def _digest(plain: Any) -> str:  # noqa: ANN401
    text = json.dumps(plain, sort_keys=True, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def encode(value: Any) -> Any:  # noqa: ANN401
    """Return `value` as what JSON can hold; floats keep every bit.

    Raises:
        TypeError: a value of a kind that has no plain form.
    """
    if isinstance(value, np.ndarray):
        return _encode_array(value)
    if isinstance(value, np.generic):
        return encode(value.item())
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, bytes):
        return {"bytes": base64.b64encode(value).decode("ascii")}
    if isinstance(value, float):
        return value if math.isfinite(value) else {"number": repr(value)}
    if isinstance(value, Enum):
        return {"type": type(value).__name__, "value": encode(value.value)}
    names = _field_names(type(value))
    if names is not None:
        inside = {name: encode(getattr(value, name)) for name in names}
        return {"type": type(value).__name__, "fields": inside}
    if isinstance(value, list | tuple):
        return [encode(item) for item in value]
    if isinstance(value, Mapping):
        return {"items": [[encode(k), encode(v)] for k, v in value.items()]}
    raise TypeError(f"{type(value).__name__} has no plain form")


def decode(plain: Any, types: Types) -> Any:  # noqa: ANN401
    """Return the value of `encode`, with tuples for lists.

    Args:
        plain: what `encode` made, or anything else.
        types: every type that may appear, by name.

    Raises:
        ValueError: not the plain form of such a value.
    """
    if isinstance(plain, list):
        return tuple(decode(item, types) for item in plain)
    if not isinstance(plain, dict):
        return plain
    try:
        return _decode_tagged(plain, types)
    except (KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"no plain form: {error!r}") from error


def _decode_tagged(plain: dict[str, Any], types: Types) -> Any:  # noqa: ANN401
    match plain:
        case {"array": data, "dtype": kind, "shape": shape}:
            return _decode_array(data, kind, shape)
        case {"bytes": data}:
            return base64.b64decode(data, validate=True)
        case {"number": "inf" | "-inf" | "nan" as text}:
            return float(text)
        case {"items": items}:
            return {decode(k, types): decode(v, types) for k, v in items}
        case {"type": name, "value": inside} if issubclass(types[name], Enum):
            return types[name](decode(inside, types))
        case {"type": name, "fields": inside}:
            kind = types[name]
            if set(inside) != set(_field_names(kind) or ()):
                raise ValueError(f"{name} has other fields")
            return kind(**{key: decode(item, types) for key, item in inside.items()})
    raise ValueError("an object of no known form")


def _encode_array(array: np.ndarray) -> dict[str, Any]:
    kind = array.dtype.name
    if kind not in _DTYPES:
        raise TypeError(f"an array of {kind} has no plain form")
    data = np.ascontiguousarray(array, dtype=_DTYPES[kind]).tobytes()
    text = base64.b64encode(data).decode("ascii")
    return {"array": text, "dtype": kind, "shape": list(array.shape)}


def _decode_array(data: str, kind: str, shape: list[int]) -> np.ndarray:
    raw = base64.b64decode(data, validate=True)
    flat = np.frombuffer(raw, dtype=_DTYPES[kind])
    if any(side < 0 for side in shape) or math.prod(shape) != flat.size:
        raise ValueError(f"{flat.size} numbers for an array of shape {shape}")
    return flat.astype(kind).reshape(shape)


def _field_names(kind: type) -> tuple[str, ...] | None:
    if is_dataclass(kind):
        return tuple(item.name for item in fields(kind))
    return getattr(kind, "_fields", None)


def write_atomic(path: Path, content: bytes) -> None:
    """Write `content` to `path`: a reader sees the old file or the new, never a part.

    Missing folders are made.

    Raises:
        SettingsError: the folder cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with open_directory(path.parent) as folder:
            replace_file(folder, path.name, content)
    except OSError as error:
        raise SettingsError(
            f"{path}: cannot be written ({error.strerror}).",
            hint="Name a folder that you may write to, with space left.",
        ) from error
