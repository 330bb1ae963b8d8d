"""Names: of the targets, and of terrains as harmless parts of other languages."""

import importlib
import pkgutil
import re
from collections.abc import Iterable

TARGETS = "analysis.terrains.export.targets"  # package, a module for each
_LONGEST, _LONGEST_SHOWN = 40, 60  # characters


def target_names() -> tuple[str, ...]:
    """Return the names of all targets: those of the modules of `targets`."""
    package = importlib.import_module(TARGETS)
    return tuple(sorted(each.name for each in pkgutil.iter_modules(package.__path__)))


def shown(text: str) -> str:
    """Return a text for comments and titles: a line of letters, digits, " .,:()_+-".

    No character of it ends a comment or a string of any language.
    """
    return re.sub(r"[^A-Za-z0-9 .,:()_+-]", "?", text)[:_LONGEST_SHOWN].strip() or "?"


def identifiers(names: Iterable[str]) -> dict[str, str]:
    """Return letters, digits and underscores for every name, each once.

    They differ in more than capitals, since they become names of files too.
    """
    found: dict[str, str] = {}
    taken: set[str] = set()
    for name in names:
        word = re.sub(r"[^A-Za-z0-9]+", "_", name).strip("_")[:_LONGEST] or "terrain"
        unique, number = word, 2
        while unique.lower() in taken:
            unique, number = f"{word}_{number}", number + 1
        taken.add(unique.lower())
        found[name] = unique
    return found
