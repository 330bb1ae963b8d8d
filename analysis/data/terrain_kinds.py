"""The kind of a terrain: its grain size, a flat plate, or its own.

The size of the stones is a fact of the recording (`stones` or d50 in matrix.toml,
`stone_size` in a trial's metadata) or is given with a table; it never follows from a
terrain's name. Only where nothing is recorded do the eight names of the paper stand for
their stones. Any other terrain of unknown stones is a kind of its own, under its own
name.
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
_OTHER_INCLINE = 2.5  # degrees; half of what the paper's differ by
_TITLES = {
    SMALL: "small stones",
    BIG: "big stones",
    FLAT: "flat plate",
    FINE: "fine ground",
    STONES: "stones",
}


def stones_of(ground: str, d50: float | None) -> str:
    """Return the word for stones that a recording states.

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
    """Return "plate", "fine" or "stones" for a grain size [mm]; None = has none."""
    if d50 is None:
        return "plate"
    return FINE if d50 < FINEST_STONES else STONES


def _stated(word: str) -> str:
    """Return the kind that a recorded size of stones stands for, "" for none."""
    if word in (FINE, STONES) or _MILLIMETRES.fullmatch(word):
        return word
    return STONE_SIZES.get(word, "")


def terrain_kind(terrain: str, stones: Iterable[str] = ()) -> str:
    """Return "small", "big", "flat", e.g. "12 mm", "fine" or "stones".

    The terrain's own name where it is unknown.

    Args:
        terrain: its name.
        stones: sizes that its recordings state: "small", "big", "none", e.g. "12 mm",
            "fine" or "stones"; any other text states nothing. Recordings that
            contradict each other make the terrain a kind of its own.
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
        terrain: its name; those of the paper stand for their incline.
        inclines: what its recordings state [degrees]; None states nothing. Their
            median counts.
    """
    stated = [angle for angle in inclines if angle is not None]
    return median(stated) if stated else PAPER_INCLINES.get(terrain)


def is_papers(terrain: str, kind: str, incline_deg: float | None) -> bool:
    """Whether a terrain is one of the paper's: its name, stones and incline.

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
    """Return a kind in words, e.g. "small stones"; a terrain's own kind is its name."""
    return (
        f"stones of {kind}" if _MILLIMETRES.fullmatch(kind) else _TITLES.get(kind, kind)
    )


def is_stony(kind: str) -> bool:
    """Whether the ground is of stones, of whatever size."""
    return (
        kind == STONES
        or kind in SIZE_BY_WORD
        or _MILLIMETRES.fullmatch(kind) is not None
    )


def surface_of(kind: str) -> str:
    """Return "flat" or "rocky"; fine ground and an own kind stay what they are."""
    return "rocky" if is_stony(kind) else kind


def groups_of(kinds: Mapping[str, str]) -> dict[str, dict[str, str]]:
    """Return what every terrain counts as, by level: its name, its stones, its surface.

    Args:
        kinds: kind by name of the terrain.
    """
    return {
        "terrain": {name: name for name in kinds},
        "stones": dict(kinds),
        "surface": {name: surface_of(kind) for name, kind in kinds.items()},
    }


def parse_stones(text: str) -> dict[str, str]:
    """Return the size of the stones by terrain from `Sand=none,Beach=small`.

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
