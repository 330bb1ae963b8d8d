"""What a kept result is known by: the value of its task and the code that computes it.

A result that is kept on the disk must never outlive the formula that made it. Its key
therefore contains a digest of the function's module and of every module of the project
that this module imports, directly or not; and the versions of the numerical libraries.
What the function does not import, as a fit no figure's colours, changes nothing.
"""

import hashlib
import re
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).parents[2]  # of the sources, or of the installation
_PACKAGES = frozenset({"acquisition", "analysis", "experiments", "ft_sensor", "wam"})
_LIBRARIES = ("matplotlib", "numpy", "pillow", "scipy")
_PLAIN = (type(None), bool, int, float, str, bytes, Enum)
# `from a.b import c, d` or `import a.b`, also inside a function
_IMPORT = re.compile(
    r"^[ \t]*(?:from[ \t]+([\w.]+)[ \t]+import[ \t]+(\([^)]*\)|[^\n#]*)"
    r"|import[ \t]+([\w.]+))",
    re.MULTILINE,
)


def code_digest(module: str, root: Path = ROOT) -> str:
    """Return the SHA-256 of a module, of what it imports and of the libraries.

    Args:
        module: e.g. "analysis.study.crossval".
        root: folder of the project's packages.
    """
    return _code_digest(module, root)


@cache
def _code_digest(module: str, root: Path) -> str:
    digest = hashlib.sha256(" ".join(map(version, _LIBRARIES)).encode())
    for name, path in sorted(source_files(module, root).items()):
        content = path.read_bytes()
        digest.update(f" {name} {len(content)} ".encode())
        digest.update(content)
    return digest.hexdigest()


def source_files(module: str, root: Path = ROOT) -> dict[str, Path]:
    """Return the project's files behind a module by name, its own among them."""
    found: dict[str, Path] = {}
    waiting = [module]
    while waiting:
        name = waiting.pop()
        path = _file_of(name, root)
        if name in found or path is None:
            continue
        found[name] = path
        waiting.extend(_imports_of(path))
    return found


def _file_of(module: str, root: Path) -> Path | None:
    """Return the file of a module of the project, None for anything else."""
    if module.partition(".")[0] not in _PACKAGES:
        return None
    base = root.joinpath(*module.split("."))
    files = (base.with_suffix(".py"), base / "__init__.py")
    return next((path for path in files if path.is_file()), None)


def _imports_of(path: Path) -> Iterator[str]:
    """Yield every module that a file may import; a name in it counts as one, too."""
    for module, names, plain in _IMPORT.findall(path.read_text(encoding="utf-8")):
        yield plain or module
        yield from (f"{module}.{name}" for name in re.findall(r"\w+", names))


def value_digest(value: Any) -> str:  # noqa: ANN401
    """Return the SHA-256 of a value: dataclasses, arrays, mappings, plain values.

    Raises:
        TypeError: a value of a kind whose content is not known.
    """
    digest = hashlib.sha256()
    for part in _parts(value):
        digest.update(len(part).to_bytes(8, "little"))
        digest.update(part)
    return digest.hexdigest()


def _parts(value: Any) -> Iterator[bytes]:  # noqa: ANN401
    """Give the bytes of a value, each with its kind and the count of what is inside."""
    if isinstance(value, np.generic):  # the store gives it back as a plain value
        value = value.item()
    kind = type(value).__name__
    if isinstance(value, np.ndarray):
        yield f"{kind} {value.dtype.str} {value.shape}".encode()
        yield value.tobytes()
    elif isinstance(value, _PLAIN):
        yield f"{kind} {value!r}".encode()
    elif isinstance(value, Mapping) or is_dataclass(value):
        inside = value if isinstance(value, Mapping) else _fields_of(value)
        yield f"{kind} {len(inside)}".encode()
        for key, item in inside.items():
            yield from _parts(key)
            yield from _parts(item)
    elif isinstance(value, list | tuple):
        yield f"{kind} {len(value)}".encode()
        for item in value:
            yield from _parts(item)
    else:
        raise TypeError(f"{kind} has no digest")


def _fields_of(value: Any) -> dict[str, Any]:  # noqa: ANN401
    return {item.name: getattr(value, item.name) for item in fields(value)}
