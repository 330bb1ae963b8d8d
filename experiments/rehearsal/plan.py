"""Plan of a rehearsal: terrains, trials and arm."""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class AcceptancePlan:
    """Plan of a rehearsal.

    Attributes:
        config: a rig.toml; None = as shipped.
        terrains: names of the terrains, in the matrix's order.
        plates: terrains without stones; stored with the results.
        travel: length of the shortest container [m].
        trials: number of trials per terrain.
        seed: seed of all random numbers.
        friction: joint friction as a share of that identified on another arm.
        jobs: number of parallel processes; None = one per core.
        cables: resonance of the joints on their cables [Hz]; None = stiff cables.
        mount: true rotations of the base about x, then y, then z [degrees]; None =
            none.
        wrong: name of the wrong rig; "" = none.
    """

    config: Path | None
    terrains: tuple[str, ...]
    plates: tuple[str, ...]
    travel: float
    trials: int
    seed: int
    friction: float
    jobs: int | None
    cables: float | None = None
    mount: tuple[float, float, float] | None = None
    wrong: str = ""
