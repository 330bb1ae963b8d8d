"""Check that no other package of the same name shadows those of the program."""

from functools import cache
from importlib.util import find_spec
from pathlib import Path

OWN = ("acquisition", "analysis", "experiments", "fakes", "ft_sensor", "wam")


@cache
def check_packages() -> None:
    """Check that Python imports every package of the program from its own folder.

    Raises:
        ImportError: another folder or module of the same name comes first, or one of
            the packages is missing.
    """
    home = Path(__file__).resolve().parent.parent
    for name in OWN:
        locations = _locations(name)
        if (home / name) in locations:
            continue
        if not locations:
            raise ImportError(
                f"Traction is not complete: its package {name!r} is missing beside "
                f"{home / 'traction'}. Install it again.",
                name=name,
            )
        raise ImportError(
            f"{locations[0]} hides the package {name!r} of Traction, which is "
            f"{home / name}. Rename the one that hides it, or start Python in another "
            "folder.",
            name=name,
        )


def _locations(name: str) -> list[Path]:
    """Return the folders or the file from which Python would import a package."""
    try:
        spec = find_spec(name)
    except (ImportError, ValueError):  # a module without a specification
        return []
    if spec is None:
        return []
    locations = list(spec.submodule_search_locations or [])
    if not locations and spec.origin:
        locations = [spec.origin]
    return [Path(location).resolve() for location in locations]
