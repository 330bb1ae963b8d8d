"""Kind of a terrain: its grain size, "flat" for a plate, or the terrain's own name.

The size of the stones is recorded (`stones` or d50 in matrix.toml, `stone_size` in a
trial's metadata) or given with a table; it is not derived from a terrain's name. Only
if nothing is recorded do the eight names of the paper imply their stones. Any other
terrain of unknown stones is a kind of its own, under its own name.
"""

import re
from collections.abc import Iterable, Mapping
from statistics import median

from acquisition.errors import SettingsError

Value = float | str | None  # of a factor; None = does not apply
SMALL, BIG, FLAT = "small", "big", "flat"
FINE, STONES = "fine", "stones"  # below 2 mm; stones of unknown size
STONE_SIZES: Mapping[str, str] = {"small": SMALL, "big": BIG, "none": FLAT}
SIZE_BY_WORD: Mapping[str, float] = {"small": 19.0, "big": 37.0}  # d50 [mm]
FINEST_STONES = 2.0  # mm
_MILLIMETRES = re.compile(r"\d{1,4}(?:\.\d{1,6})? mm")
PAPER_KINDS: Mapping[str, str] = {
    **dict.fromkeys(("S0", "S10", "S15"), SMALL),
    **dict.fromkeys(("B0", "B10", "B15"), BIG),
    **dict.fromkeys(("TF", "Tf"), FLAT),
}
PAPER_INCLINES: Mapping[str, float] = {
    **dict.fromkeys(("S0", "B0", "TF", "Tf"), 0.0),
    **dict.fromkeys(("S10", "B10"), 10.0),
    **dict.fromkeys(("S15", "B15"), 15.0),
}
_OTHER_INCLINE = 2.5  # degrees; half of the smallest difference in the paper
_TITLES = {
    SMALL: "small stones",
    BIG: "big stones",
    FLAT: "flat plate",
    FINE: "fine ground",
    STONES: "stones",
}


def stones_of(ground: str, d50: float | None) -> str:
    """Return the stone size as recordings state it.

    Args:
        ground: "stones", "plate" or "fine".
        d50: grain size [mm]; None = not stated.
    """
    if ground == "plate":
        return "none"
    if ground == FINE or d50 is None:
        return FINE if ground == FINE else STONES
    words = {size: word for word, size in SIZE_BY_WORD.items()}
    return words.get(d50, f"{round(d50, 6):g} mm")


def ground_of(d50: float | None) -> str:
    """Return "plate", "fine" or "stones" for a grain size [mm]; None for a plate."""
    if d50 is None:
        return "plate"
    return FINE if d50 < FINEST_STONES else STONES


def _stated(word: str) -> str:
    """Return the kind for a recorded stone size; "" if the text states none."""
    if word in (FINE, STONES) or _MILLIMETRES.fullmatch(word):
        return word
    return STONE_SIZES.get(word, "")


def terrain_kind(terrain: str, stones: Iterable[str] = ()) -> str:
    """Return the kind: "small", "big", "flat", "fine", "stones" or e.g. "12 mm".

    The terrain's own name if the kind is unknown.

    Args:
        terrain: its name.
        stones: sizes stated by its recordings: "small", "big", "none", "fine", "stones"
            or e.g. "12 mm"; any other text is ignored. Contradictory recordings make
            the terrain a kind of its own.
    """
    stated = {kind for kind in map(_stated, stones) if kind}
    if not stated:
        return PAPER_KINDS.get(terrain, terrain)
    return stated.pop() if len(stated) == 1 else terrain


def terrain_incline(
    terrain: str, inclines: Iterable[float | None] = ()
) -> float | None:
    """Return the incline of a terrain [degrees], None where it is unknown.

    Args:
        terrain: its name; the names of the paper imply their incline.
        inclines: inclines stated by its recordings [degrees], None where not stated;
            their median is used.
    """
    stated = [angle for angle in inclines if angle is not None]
    return median(stated) if stated else PAPER_INCLINES.get(terrain)


def is_paper_terrain(terrain: str, kind: str, incline_deg: float | None) -> bool:
    """Whether a terrain matches one of the paper's by name, stones and incline.

    Args:
        terrain: its name.
        kind: its kind.
        incline_deg: its incline [degrees]; None = unknown.
    """
    if PAPER_KINDS.get(terrain) != kind:
        return False
    return incline_deg is None or (
        abs(incline_deg - PAPER_INCLINES[terrain]) < _OTHER_INCLINE
    )


def kind_title(kind: str) -> str:
    """Return a kind in words, e.g. "small stones"; an own kind gives its own name."""
    return (
        f"stones of {kind}" if _MILLIMETRES.fullmatch(kind) else _TITLES.get(kind, kind)
    )


def is_stony(kind: str) -> bool:
    """Whether the ground consists of stones of any size."""
    return (
        kind == STONES
        or kind in SIZE_BY_WORD
        or _MILLIMETRES.fullmatch(kind) is not None
    )


def surface_of(kind: str) -> str:
    """Return "flat" or "rocky"; fine ground and own kinds are returned unchanged."""
    return "rocky" if is_stony(kind) else kind


def class_labels(kinds: Mapping[str, str]) -> dict[str, dict[str, str]]:
    """Return the class of every terrain at each level: name, stones and surface.

    Args:
        kinds: kind by terrain name.
    """
    return {
        "terrain": {name: name for name in kinds},
        "stones": dict(kinds),
        "surface": {name: surface_of(kind) for name, kind in kinds.items()},
    }


def parse_stones(text: str) -> dict[str, str]:
    """Parse stone sizes by terrain, e.g. `Sand=none,Beach=small`.

    Raises:
        SettingsError: a part is not TERRAIN=SIZE, or there is no such size.
    """
    stones: dict[str, str] = {}
    for part in filter(None, text.split(",")):
        terrain, equals, size = (piece.strip() for piece in part.rpartition("="))
        if not (equals and terrain and _stated(size)):
            raise SettingsError(
                f"--stones {text}: {part!r} does not give the stones of a terrain.",
                hint=f"The sizes are {', '.join(STONE_SIZES)}, fine, stones, or e.g. "
                '"12 mm"; write e.g. --stones Sand=none,Beach=small',
            )
        stones[terrain] = size
    return stones
