"""Cache of study results on disk, keyed by the hash of task and code.

An interrupted study resumes where it stopped, and a study repeated with one changed
option recomputes only what the option affects. A result is keyed by its task and by the
code that computed it, so that a corrected formula never shows an old number. When the
folder exceeds its size limit, the least recently used results are removed.

Values are stored as JSON without loss. Nothing is ever unpickled: a file can name only
dataclasses, named tuples and enumerations of `analysis`, with exactly their fields.
Damaged or foreign files are ignored.
"""

import base64
import hashlib
import json
import math
import os
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cache
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.errors import SettingsError
from acquisition.files import open_directory, read_regular, replace_file

Function = Callable[..., Any]

MAX_STORE_BYTES = 256 * 1024**2  # size limit of all results; a fold takes about 60 kB
LARGEST = 16 * 1024**2  # bytes of one result; a larger file is ignored
_KEPT = 0.9  # share of the size limit that remains after a removal
_ROOT = Path(__file__).parents[2]  # of the sources or the installation
_FIGURES = "analysis.report"  # package that only draws figures
_DTYPES = ("<f8", "<i8", "|b1")  # of arrays: float, int, bool


class ResultStore:
    """Keeps one file per task below a folder.

    Args:
        folder: created with the first result; may be deleted at any time.
        most: size limit of all results [bytes].
    """

    def __init__(self, folder: Path, most: int = MAX_STORE_BYTES) -> None:
        self._folder = folder
        self._most = most
        self._bytes: int | None = None  # size of the folder, if known

    def get(self, function: Function, task: Any) -> Any | None:  # noqa: ANN401
        """Return the cached result of a task; None without one."""
        path = self._path(function, task)
        try:
            content = json.loads(read_regular(path, LARGEST))
            is_whole = content["digest"] == _digest(content["result"])
            result = decode(content["result"]) if is_whole else None
        except Exception:  # a foreign file may raise anything
            return None
        with suppress(OSError):  # read-only folder
            os.utime(path)
        return result

    def put(self, function: Function, task: Any, result: Any) -> None:  # noqa: ANN401
        """Store a result if the folder is writable.

        Raises:
            TypeError: a value in it has no plain form.
            ValueError: the value cannot be read back.
        """
        plain = encode(result)
        decode(plain)
        content = {"digest": _digest(plain), "result": plain}
        path, data = self._path(function, task), json.dumps(content).encode()
        if path.is_dir():  # name occupied: not cached
            return
        try:
            write_atomic(path, data)
        except SettingsError:  # not cached; computed again next time
            return
        if self._bytes is not None:
            self._bytes += len(data)
        if self._bytes is None or self._bytes > self._most:
            self._bytes = remove_oldest(self._folder, self._most)

    def _path(self, function: Function, task: Any) -> Path:  # noqa: ANN401
        return self._folder / f"{task_key(function, task)}.json"


def remove_oldest(folder: Path, most: int) -> int:
    """Remove the least recently used results if the total exceeds `most` bytes.

    Files removed by other processes meanwhile are ignored. Returns the remaining bytes.
    """
    files: list[tuple[int, int, Path]] = []
    for path in (*folder.glob("*.json"), *folder.glob(".*.json.*")):
        with suppress(OSError):
            status = path.lstat()
            files.append((status.st_mtime_ns, status.st_size, path))
    total = sum(size for _, size, _ in files)
    if total <= most:
        return total
    for _, size, path in sorted(files):
        if total <= _KEPT * most:
            break
        with suppress(OSError):
            path.unlink()
            total -= size
    return total


def task_key(function: Function, task: Any) -> str:  # noqa: ANN401
    """Return the hash of a task: its data, its options and the code that runs it.

    Equal values have equal keys whether or not they share objects, unlike pickles.

    Raises:
        TypeError: a value in the task has no plain form.
    """
    name = f"{function.__module__}.{function.__qualname__}"
    code = code_digest(is_drawn=name.startswith(_FIGURES))
    return _digest([name, code, encode(task, _sha256)])


@cache
def code_digest(root: Path = _ROOT, *, is_drawn: bool = False) -> str:
    """Return the SHA-256 of the sources and library versions behind the results.

    Args:
        root: folder of the project's packages.
        is_drawn: the results are figures, which depend on all of `analysis` and its
            imports; fits depend on `acquisition` and on `analysis` without figures.
    """
    packages = ["acquisition", "analysis"]
    libraries = ["numpy", "scipy"]
    if is_drawn:
        packages += ["ft_sensor", "wam"]
        libraries += ["matplotlib", "pillow"]
    drawing = root.joinpath(*_FIGURES.split("."))
    paths = (path for name in packages for path in (root / name).rglob("*.py"))
    used = [p for p in paths if is_drawn or not p.is_relative_to(drawing)]
    return sources_digest(root, used, libraries)


def sources_digest(root: Path, paths: Iterable[Path], libraries: Iterable[str]) -> str:
    """Return the SHA-256 of files below `root` and of versions of libraries."""
    digest = hashlib.sha256(" ".join(map(version, libraries)).encode())
    for path in sorted(paths):
        content = path.read_bytes()
        digest.update(f" {path.relative_to(root)} {len(content)} ".encode())
        digest.update(content)
    return digest.hexdigest()


def _digest(plain: Any) -> str:  # noqa: ANN401
    return _sha256(json.dumps(plain, sort_keys=True, allow_nan=False).encode())


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _base64(content: bytes) -> str:
    return base64.b64encode(content).decode("ascii")


def encode(value: Any, text: Callable[[bytes], str] | None = None) -> Any:  # noqa: ANN401
    """Convert `value` to JSON types without loss of precision.

    Args:
        value: dataclasses, named tuples, enumerations, arrays, mappings, sequences,
            numbers, texts, bytes.
        text: function that represents bytes as text; by default readable by `decode`.

    Raises:
        TypeError: a value has no plain form.
    """
    text = text or _base64
    if isinstance(value, np.ndarray) and not value.dtype.hasobject:
        kind, shape = value.dtype.str, list(value.shape)
        return {"array": text(value.tobytes()), "dtype": kind, "shape": shape}
    if isinstance(value, np.generic):
        return encode(value.item())
    if isinstance(value, Enum):
        return {"type": _name(type(value)), "value": encode(value.value)}
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, bytes):
        return {"bytes": text(value)}
    if isinstance(value, float):
        return value if math.isfinite(value) else {"number": repr(value)}
    names = _field_names(type(value))
    if names is not None:
        plain = {name: encode(getattr(value, name), text) for name in names}
        return {"type": _name(type(value)), "fields": plain}
    if isinstance(value, list | tuple):
        return [encode(item, text) for item in value]
    if isinstance(value, Mapping):
        items = value.items()
        return {"items": [[encode(k), encode(item, text)] for k, item in items]}
    raise TypeError(f"{type(value).__name__} has no plain form")


def decode(plain: Any) -> Any:  # noqa: ANN401
    """Invert `encode`; lists become tuples.

    Raises:
        ValueError: not a plain form made by `encode`.
    """
    if isinstance(plain, list):
        return tuple(decode(item) for item in plain)
    if not isinstance(plain, dict):
        return plain
    try:
        return _decode_tagged(plain)
    except (KeyError, TypeError, AttributeError, ImportError) as error:
        raise ValueError(f"no plain form: {error!r}") from error


def _decode_tagged(plain: dict[str, Any]) -> Any:  # noqa: ANN401
    match plain:
        case {"array": data, "dtype": kind, "shape": shape}:
            return _decode_array(data, kind, shape)
        case {"bytes": data}:
            return base64.b64decode(data, validate=True)
        case {"number": "inf" | "-inf" | "nan" as text}:
            return float(text)
        case {"items": items}:
            return {decode(key): decode(item) for key, item in items}
        case {"type": name, "value": inside} if issubclass(_type(name), Enum):
            return _type(name)(decode(inside))
        case {"type": name, "fields": inside}:
            kind = _type(name)
            if set(inside) != set(_field_names(kind) or ()):
                raise ValueError(f"{name} has other fields")
            return kind(**{key: decode(item) for key, item in inside.items()})
    raise ValueError("an object of no known form")


def _name(kind: type) -> str:
    return f"{kind.__module__}.{kind.__qualname__}"


def _type(name: str) -> Any:  # noqa: ANN401
    """Look up a type that a result may contain.

    Raises:
        ValueError: not a dataclass, named tuple or enumeration of `analysis`.
        ImportError, AttributeError: there is no such type.
    """
    module, _, own = name.rpartition(".")
    if not module.startswith("analysis."):
        raise ValueError(f"{name} is not of this analysis")
    kind = getattr(import_module(module), own)
    is_value = isinstance(kind, type) and (
        _field_names(kind) is not None or issubclass(kind, Enum)
    )
    if not is_value or _name(kind) != name:  # excludes names imported by the module
        raise ValueError(f"{name} is no value of this analysis")
    return kind


def _field_names(kind: type) -> tuple[str, ...] | None:
    if is_dataclass(kind):
        return tuple(item.name for item in fields(kind))
    return getattr(kind, "_fields", None)


def _decode_array(data: str, kind: str, shape: list[int]) -> np.ndarray:
    if kind not in _DTYPES:
        raise ValueError(f"an array of {kind}")
    flat = np.frombuffer(base64.b64decode(data, validate=True), dtype=kind)
    if any(side < 0 for side in shape) or math.prod(shape) != flat.size:
        raise ValueError(f"{flat.size} numbers for an array of shape {shape}")
    return flat.copy().reshape(shape)  # writable


def write_atomic(path: Path, content: bytes) -> None:
    """Write `content` to `path` atomically: readers see the old or the new file.

    Missing folders are created.

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
