"""Names of the targets, and of terrains as identifiers of other languages."""

import importlib
import pkgutil
import re
from collections.abc import Iterable

from acquisition.errors import SettingsError

TARGETS = "analysis.terrains.export.targets"  # package with one module per target
_LONGEST, _LONGEST_SHOWN = 40, 60  # characters


def target_names() -> tuple[str, ...]:
    """Return the names of all targets: the modules of the package `targets`."""
    package = importlib.import_module(TARGETS)
    modules = pkgutil.iter_modules(package.__path__)
    return tuple(sorted(module.name for module in modules))


def shown(text: str) -> str:
    """Sanitise a text for comments and titles: letters, digits and " .,:()_+-".

    None of these ends a comment or a string in any language.
    """
    return re.sub(r"[^A-Za-z0-9 .,:()_+-]", "?", text)[:_LONGEST_SHOWN].strip() or "?"


def identifiers(names: Iterable[str]) -> dict[str, str]:
    """Return an identifier of letters, digits and underscores for every name.

    A sign or a point next to a digit is encoded: +10 becomes p10, -10 m10 and 12.5
    12p5. Identifiers differ in more than case, because they also become file names.

    Raises:
        SettingsError: two names have the same identifier.
    """
    words: dict[str, str] = {}
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
        words[name] = word
    return words


def _identifier(name: str) -> str:
    word = re.sub(r"\+(?=\d)|(?<=\d)\.(?=\d)", "p", name)
    word = re.sub(r"-(?=\d)", "m", word)
    return re.sub(r"[^A-Za-z0-9]+", "_", word).strip("_")[:_LONGEST] or "terrain"
