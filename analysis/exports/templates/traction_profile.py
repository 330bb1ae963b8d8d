"""Coefficients of friction of terrains, each for a whole episode; needs numpy alone.

    profile = load_profile("S0")
    mu = profile.draw(numpy.random.default_rng(1).random(4096))

`profile.json` beside this file says for which window of F_n and v_t they hold, which
share of the distribution was below 0 and is 0, and what no coefficient holds.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

PROFILES = Path(__file__).parent / "profile.json"


@dataclass(frozen=True)
class TerrainProfile:
    """One terrain.

    Attributes:
        shares: of the quantiles, shape (k,).
        mu: coefficient that is not reached with each share, shape (k,).
        static_over_sliding: coefficient from rest over the sliding one, at least 1.
        about: everything that `profile.json` says of it.
    """

    shares: np.ndarray
    mu: np.ndarray
    static_over_sliding: float
    about: dict[str, Any]

    def draw(self, uniform: np.ndarray) -> np.ndarray:
        """Return coefficients for numbers that are uniform from 0 to 1, same shape."""
        low, high = self.shares[0], self.shares[-1]
        return np.interp(low + (high - low) * uniform, self.shares, self.mu)

    def quantile(self, share: float) -> float:
        """Return the coefficient that is not reached with probability `share`."""
        return float(np.interp(share, self.shares, self.mu))

    def range(self) -> tuple[float, float]:
        """Return the 5 and 95 % points."""
        return self.quantile(0.05), self.quantile(0.95)


def load_profile(terrain: str, path: Path | str = PROFILES) -> TerrainProfile:
    """Return a terrain by the name that it has in the database.

    Raises:
        KeyError: there is none of that name.
    """
    terrains = json.loads(Path(path).read_text())["terrains"]
    if terrain not in terrains:
        raise KeyError(f"no terrain {terrain!r}; there are {', '.join(terrains)}")
    about = terrains[terrain]
    return TerrainProfile(
        shares=np.asarray(about["shares"]),
        mu=np.asarray(about["mu"]),
        static_over_sliding=float(about["static_over_sliding"]),
        about=about,
    )
