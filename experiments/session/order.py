"""Which terrain comes next, so that terrain and time are not one and the same."""

import math
import random
from collections.abc import Mapping, Sequence

from experiments.settings.matrix import TerrainRow

_DRAWS = 400
_SEED = 1  # the same data give the same advice


def suggest_order(rows: Sequence[TerrainRow], done: Sequence[str]) -> list[str]:
    """Return the terrains still to be recorded in a good order.

    A foot that wears, a sensor that drifts and a person who learns change with time.
    If the inclines came in rising order, nobody could tell these from the incline. So
    of many random orders that one is taken in which inclination, size of the stones
    and tread go least with the place in the whole sequence.

    Args:
        rows: the matrix.
        done: names of the terrains recorded so far, oldest first.
    """
    factors = {row.name: _factors(row) for row in rows}
    begun = [name for name in done if name in factors]
    rest = [row.name for row in rows if row.name not in begun]
    dice = random.Random(_SEED)
    orders = [dice.sample(rest, len(rest)) for _ in range(_DRAWS)]
    return min(orders, key=lambda order: confounding([*begun, *order], factors))


def confounding(order: Sequence[str], factors: Mapping[str, Sequence[float]]) -> float:
    """Return the largest |correlation| of a factor with the place in `order`."""
    columns = zip(*(factors[name] for name in order), strict=True)
    places = [float(place) for place in range(len(order))]
    return max((abs(_correlation(places, list(c))) for c in columns), default=0.0)


def _factors(row: TerrainRow) -> tuple[float, ...]:
    """Return inclination and, as 0 or 1: big stones, a plate, a bare foot."""
    signs = (row.stones == "big", row.stones == "none", row.foot == "bare")
    return (row.incline_deg, *map(float, signs))


def _correlation(x: Sequence[float], y: Sequence[float]) -> float:
    """Return Pearson's correlation, 0 where one of them does not vary."""
    mean_x, mean_y = math.fsum(x) / len(x), math.fsum(y) / len(y)
    products = [(a - mean_x) * (b - mean_y) for a, b in zip(x, y, strict=True)]
    squares_x = math.fsum((a - mean_x) ** 2 for a in x)
    squares_y = math.fsum((b - mean_y) ** 2 for b in y)
    if squares_x <= 0.0 or squares_y <= 0.0:
        return 0.0
    return math.fsum(products) / math.sqrt(squares_x * squares_y)
