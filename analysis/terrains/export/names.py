"""Names: of the targets, and of terrains as harmless parts of other languages."""

import importlib
import pkgutil
import re
from collections.abc import Iterable

from acquisition.errors import SettingsError

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
    """Letters, digits and underscores for every name, whatever other names there are.

    A sign or a point beside a digit keeps its meaning: +10 is p10, -10 is m10 and 12.5
    is 12p5. They differ in more than capitals, since they become names of files too.

    Raises:
        SettingsError: two names have one identifier.
    """
    found: dict[str, str] = {}
    name_of: dict[str, str] = {}
    for name in names:
        word = _identifier(name)
        other = name_of.setdefault(word.lower(), name)
        if other != name:
            raise SettingsError(
                f"{other!r:.60} and {name!r:.60} are both {word} where only letters, "
                "digits and underscores are allowed.",
                hint="Export them apart, or rename one of the terrains.",
            )
        found[name] = word
    return found


def _identifier(name: str) -> str:
    word = re.sub(r"\+(?=\d)|(?<=\d)\.(?=\d)", "p", name)
    word = re.sub(r"-(?=\d)", "m", word)
    return re.sub(r"[^A-Za-z0-9]+", "_", word).strip("_")[:_LONGEST] or "terrain"
