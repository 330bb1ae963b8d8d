"""Locks of the pins of constraints.txt, as PEP 751 and as hashes for older pips.

python -m tests.pylock

downloads every wheel for every supported Python into build/wheels by the index that
pip is configured for, then writes pylock.toml and constraints.lock, and prints which
versions of Python have a wheel of everything. The lock names files below build/wheels
and their checksums, no address, so that any mirror serves.
"""

import hashlib
import platform
import subprocess
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from packaging.requirements import Requirement
from packaging.tags import cpython_tags
from packaging.utils import canonicalize_name, parse_wheel_filename

ROOT = Path(__file__).parents[1]
WHEELS = Path("build/wheels")
PYTHONS = ((3, 11), (3, 12), (3, 13), (3, 14))
_GLIBC = 34  # minor version of the newest glibc that wheels may ask for: Debian 12
PLATFORMS = [f"manylinux_2_{minor}_x86_64" for minor in range(_GLIBC, 4, -1)] + [
    "manylinux2014_x86_64",
    "manylinux2010_x86_64",
    "manylinux1_x86_64",
]
HEAD = """\
# Checksums of the wheels of constraints.txt: Linux x86-64, Python 3.11 to 3.14.
# pip install --require-hashes --only-binary=:all: --no-deps -r constraints.lock
# Made by `python -m tests.pylock`, as pylock.toml is.
"""


def pinned(constraints: str) -> list[Requirement]:
    """Pins of constraints.txt, in order."""
    lines = (line.partition("#")[0].strip() for line in constraints.splitlines())
    return [Requirement(line) for line in lines if line]


def is_wanted(pin: Requirement, python: tuple[int, int]) -> bool:
    """Whether a version of Python needs a pin."""
    text = f"{python[0]}.{python[1]}"
    environment = {"python_version": text, "python_full_version": f"{text}.0"}
    return pin.marker is None or pin.marker.evaluate(environment)


def fits(wheel: str, python: tuple[int, int]) -> bool:
    """Whether a version of Python on Linux x86-64 takes a wheel."""
    tags = parse_wheel_filename(wheel)[3]
    major, minor = python
    if any(
        t.platform == "any" and t.interpreter in {"py3", f"py{major}"} for t in tags
    ):
        return True
    own = set(cpython_tags(python, platforms=PLATFORMS))
    pure = {f"py{major}", f"cp{major}{minor}"}
    return any(
        tag in own or (tag.interpreter in pure and tag.platform in PLATFORMS)
        for tag in tags
    )


def missing(
    pins: Iterable[Requirement], wheels: Sequence[str], python: tuple[int, int]
) -> list[str]:
    """Pins that a version of Python needs and that have no wheel for it."""
    return [
        str(pin)
        for pin in pins
        if is_wanted(pin, python)
        and not any(_is_of(wheel, pin) and fits(wheel, python) for wheel in wheels)
    ]


def _is_of(wheel: str, pin: Requirement) -> bool:
    name, version, *_ = parse_wheel_filename(wheel)
    return name == canonicalize_name(pin.name) and version in pin.specifier


def pylock(pins: Sequence[Requirement], sums: Mapping[str, str]) -> str:
    """Content of pylock.toml.

    Args:
        pins: requirements, each pinned to one version.
        sums: sha256 by name of the wheel.
    """
    lines = [
        "# Made by `python -m tests.pylock`: the wheels of constraints.txt.",
        'lock-version = "1.0"',
        "environments = [\"sys_platform == 'linux' and platform_machine == 'x86_64'\"]",
        f'requires-python = ">={PYTHONS[0][0]}.{PYTHONS[0][1]}"',
        'created-by = "traction"',
    ]
    for pin in sorted(pins, key=lambda p: canonicalize_name(p.name)):
        (specifier,) = pin.specifier
        lines += ["", "[[packages]]", f'name = "{canonicalize_name(pin.name)}"']
        lines.append(f'version = "{specifier.version}"')
        if pin.marker is not None:
            lines.append(f'marker = "{str(pin.marker).replace(chr(34), chr(39))}"')
        for wheel in _wheels_of(pin, sums):
            lines += [
                "[[packages.wheels]]",
                f'path = "{(WHEELS / wheel).as_posix()}"',
                f'hashes = {{ sha256 = "{sums[wheel]}" }}',
            ]
    return "\n".join(lines) + "\n"


def hash_lock(pins: Sequence[Requirement], sums: Mapping[str, str]) -> str:
    """Content of constraints.lock: the same for `pip install --require-hashes`."""
    parts: list[str] = []
    for pin in pins:
        hashes = sorted(sums[wheel] for wheel in _wheels_of(pin, sums))
        parts.append(
            " \\\n    ".join([str(pin), *(f"--hash=sha256:{h}" for h in hashes)])
        )
    return HEAD + "\n".join(parts) + "\n"


def _wheels_of(pin: Requirement, sums: Mapping[str, str]) -> list[str]:
    return sorted(wheel for wheel in sums if _is_of(wheel, pin))


def download(pins: Sequence[Requirement], python: tuple[int, int], to: Path) -> None:
    """Fetch the wheels for one version of Python that are not there yet.

    Raises:
        CalledProcessError: a wheel is not available.
    """
    wanted = to.with_suffix(".txt")
    names = (f"{p.name}{p.specifier}\n" for p in pins if is_wanted(p, python))
    wanted.write_text("".join(names))
    words = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps"]
    words += ["--disable-pip-version-check", "--only-binary=:all:"]
    words += ["--python-version", f"{python[0]}.{python[1]}", "--dest", str(to)]
    for name in PLATFORMS:
        words += ["--platform", name]
    subprocess.run([*words, "--requirement", str(wanted)], check=True)


def main() -> int:
    """Make both locks; 1 if a version of Python lacks a wheel."""
    if platform.system() != "Linux":
        raise SystemExit("The lock is of Linux x86-64: make it there.")
    pins = pinned((ROOT / "constraints.txt").read_text())
    folder = ROOT / WHEELS
    folder.mkdir(parents=True, exist_ok=True)
    for python in PYTHONS:
        try:
            download(pins, python, folder)
        except subprocess.CalledProcessError:
            print(f"Python {python[0]}.{python[1]}: a wheel is not to be had")  # noqa: T201
            return 1
    names = sorted(path.name for path in folder.glob("*.whl"))
    names = [name for name in names if any(_is_of(name, pin) for pin in pins)]
    sums = {n: hashlib.sha256((folder / n).read_bytes()).hexdigest() for n in names}
    for python in PYTHONS:
        lacking = missing(pins, names, python)
        verdict = "lacks " + ", ".join(lacking) if lacking else "every wheel resolves"
        print(f"Python {python[0]}.{python[1]}: {verdict}")  # noqa: T201
    (ROOT / "pylock.toml").write_text(pylock(pins, sums))
    (ROOT / "constraints.lock").write_text(hash_lock(pins, sums))
    return 0


if __name__ == "__main__":
    sys.exit(main())
