"""Which dynamics the simulation runs on, and where their machine code is kept."""

import hashlib
import json
import os
from functools import cache
from importlib import import_module
from pathlib import Path

from acquisition.errors import SettingsError

COMPILED, PINOCCHIO = "compiled", "pinocchio"
ENVIRONMENT = "TRACTION_DYNAMICS"  # chooses one of them; unset = compiled if possible
_CACHE = "NUMBA_CACHE_DIR"
_FAKES = Path(__file__).parents[1]
_PACKAGE_CACHE = _FAKES / "kernels" / "__pycache__"
_READY = "ready"


def chosen_dynamics() -> str:
    """Return `COMPILED` or `PINOCCHIO`.

    Raises:
        SettingsError: the environment asks for what is not there.
    """
    wanted = os.environ.get(ENVIRONMENT, "")
    if wanted not in ("", COMPILED, PINOCCHIO):
        raise SettingsError(
            f"{ENVIRONMENT} = {wanted}: the simulation knows no such dynamics.",
            hint=f"Use {COMPILED} or {PINOCCHIO}, or unset it. Nothing was started.",
        )
    if wanted == PINOCCHIO:
        return PINOCCHIO
    if _has_numba() and kernel_folder() is not None:
        return COMPILED
    if wanted == COMPILED:
        raise SettingsError(
            f"{ENVIRONMENT} = {COMPILED}, but numba is not installed, or there is no "
            "folder to keep its machine code in.",
            hint=f"pip install 'traction[fast]', set {_CACHE} to a folder that can be "
            f"written, or unset {ENVIRONMENT}. Nothing was started.",
        )
    return PINOCCHIO


@cache
def _has_numba() -> bool:
    """Return whether numba can be imported; it refuses some versions of numpy."""
    try:
        import_module("numba")
    except ImportError:
        return False
    return True


@cache
def kernel_folder() -> Path | None:
    """Return the folder of the machine code; None if no folder can be written.

    It is named after the sources, so that no other version's machine code is ever run:
    below the folder that the environment names for numba, else in the package, else in
    the user's cache. What lies in it is executed, so it has to be the user's alone.
    """
    for place in _places():
        folder = place / f"traction-{_source_digest()}"
        try:
            place.mkdir(parents=True, exist_ok=True)
            folder.mkdir(mode=0o700, exist_ok=True)
            is_own = _is_own(folder)
        except OSError:
            continue
        if is_own and os.access(folder, os.W_OK | os.X_OK):
            _clear_damaged(folder)
            return folder
    return None


def _is_own(folder: Path) -> bool:
    """Return whether nobody but this user can put machine code into `folder`."""
    status = folder.stat()
    return status.st_uid == os.geteuid() and not status.st_mode & 0o022


def is_compiled_first() -> bool:
    """Return whether a simulation that is built now is to be compiled first."""
    folder = kernel_folder()
    is_ready = folder is not None and (folder / _READY).exists()
    return not is_ready and chosen_dynamics() == COMPILED


def mark_ready() -> None:
    """Note the files of the machine code by their digests, once it is there."""
    folder = kernel_folder()
    if folder is None or (folder / _READY).exists():
        return
    files = {str(p.relative_to(folder)): _digest(p) for p in _kept(folder)}
    part = folder / f"{_READY}.{os.getpid()}"
    part.write_text(json.dumps(files))
    part.replace(folder / _READY)


def _clear_damaged(folder: Path) -> None:
    """Remove all machine code if a file is not what was noted, as after a power cut.

    Numba would fail on it at every start. Where nothing is noted yet, another process
    may be compiling, and only files without content go.
    """
    try:
        noted: dict[str, str] = json.loads((folder / _READY).read_text())
        is_whole = all(_digest(folder / name) == noted[name] for name in noted)
    except FileNotFoundError:
        is_whole = not (folder / _READY).exists()
    except (OSError, ValueError, AttributeError):
        is_whole = False
    for path in _kept(folder):
        if not is_whole or path.stat().st_size == 0:
            path.unlink(missing_ok=True)
    if not is_whole:
        (folder / _READY).unlink(missing_ok=True)


def _kept(folder: Path) -> list[Path]:
    """Return the files that numba keeps: indices and machine code."""
    return sorted((*folder.rglob("*.nbi"), *folder.rglob("*.nbc")))


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _places() -> list[Path]:
    named = os.environ.get(_CACHE)
    home = os.environ.get("XDG_CACHE_HOME")
    user = Path(home) if home else Path("~/.cache").expanduser()
    places = [_PACKAGE_CACHE, user / "traction"]
    return [Path(named)] if named else places


def _source_digest() -> str:
    """Return a digest of the sources that the machine code is made of."""
    digest = hashlib.sha256()
    for name in ("ground", "kernels", "plant", "pucks", "sensor"):
        for path in sorted((_FAKES / name).rglob("*.py")):
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]
