"""What is rehearsed: which terrains, how often, with which arm."""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class AcceptancePlan:
    """What is rehearsed.

    Attributes:
        config: a rig.toml; None = as shipped.
        terrains: names of the terrains, in the matrix's order.
        plates: those of them without stones by the matrix; kept with the results.
        travel: length of the shortest container [m].
        trials: of each.
        seed: of everything random.
        friction: of the joints, as a share of what was identified on another arm.
        jobs: processes at a time; None = one per core.
        cables: resonance of the joints on their cables [Hz]; None = stiff ones.
        mount: turns of the true base about x, then y, then z [degrees]; None = none.
        wrong: name of the wrong rig that it is; "" = none.
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
