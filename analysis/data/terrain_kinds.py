"""The kind of a terrain: small stones, big stones, a flat plate, or its own.

The size of the stones is a fact of the recording (`stones` in matrix.toml, `stone_size`
in a trial's metadata) or is given with a table; it never follows from a terrain's name.
Only where nothing is recorded do the eight names of the paper stand for their stones.
Any other terrain of unknown stones is a kind of its own, under its own name.
"""

from collections.abc import Iterable, Mapping
from statistics import median

from acquisition.errors import SettingsError

SMALL, BIG, FLAT = "small", "big", "flat"
STONE_SIZES: Mapping[str, str] = {"small": SMALL, "big": BIG, "none": FLAT}
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
LEVELS = ("terrain", "stones", "surface")
_TITLES = {SMALL: "small stones", BIG: "big stones", FLAT: "flat plate"}


def terrain_kind(terrain: str, stones: Iterable[str] = ()) -> str:
    """Return "small", "big" or "flat"; the terrain's own name where it is unknown.

    Args:
        terrain: its name.
        stones: sizes that its recordings state: "small", "big" or "none"; any other
            text states nothing. Recordings that contradict each other make the
            terrain a kind of its own.
    """
    stated = {STONE_SIZES[size] for size in stones if size in STONE_SIZES}
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


def kind_title(kind: str) -> str:
    """Return a kind in words, e.g. "small stones"; a terrain's own kind is its name."""
    return _TITLES.get(kind, kind)


def surface_of(kind: str) -> str:
    """Return "flat" or "rocky"; a terrain's own kind stays what it is."""
    if kind in (SMALL, BIG):
        return "rocky"
    return kind


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
        if not (equals and terrain) or size not in STONE_SIZES:
            raise SettingsError(
                f"--stones {text}: {part!r} does not give the stones of a terrain.",
                hint=f"The sizes are {', '.join(STONE_SIZES)}; write e.g. "
                "--stones Sand=none,Beach=small",
            )
        stones[terrain] = size
    return stones
