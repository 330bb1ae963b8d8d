"""F_n of a foot that a hand slides at a constant speed, by how much friction is left.

python -m studies.friction_sliding FOLDER [FOLDER ...] [--write docs/friction.md]

Each FOLDER is one of `python -m studies.friction_calibrations --keep` or of
`python -m studies.friction --keep`: it has what a calibration found of a simulated
arm, and what the arm really has. The foot is put down on a plate at the far end and
slid from there. Exits with 1 where the compensated load is off by more than 1 N.
"""

import argparse
import sys
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acquisition.control_loop.states import ArmState
from fakes.ground.terrain import GroundChoice, make_terrain
from fakes.plant.push import HandView, Vector3
from studies.friction_page import with_sliding
from tests.fakes.scenes import CONSTANTS
from tests.fakes.world.holding import HoldBench
from wam.calibration.friction_file import friction_from_toml
from wam.control.friction_compensation import FrictionCompensation, known_friction
from wam.model.friction import friction_of

SPEEDS = (0.001, 0.005, 0.020)  # m/s
SHARES = (0.0, 0.7, 0.8)  # compensated
MOST = 1.0  # N
MASS = 0.3  # kg, virtual
_WEIGHT = 9.81 * MASS
_WAY, _LONGEST = 0.03, 12.0  # m, s
_RESTS, _STANDS = 3.0, 0.4  # s
_K, _B, _ASIDE = 2000.0, 150.0, 400.0  # N/m, N s/m, N/m


@dataclass(frozen=True, slots=True)
class SlidLoad:
    """How far F_n is from the weight of the virtual mass [N].

    Attributes:
        rest: while the foot stands.
        sliding: mean of the second half of the way, by speed.
    """

    rest: float
    sliding: tuple[float, ...]


class SlidingHand:
    """A hand that slides the foot at `speed` [m/s] and presses neither up nor down."""

    def __init__(self, speed: float) -> None:
        self._x: float | None = None
        self._speed = speed
        self.is_holding = self.is_done = True

    def step(self, view: HandView) -> Vector3:
        """Return the force on the hand point along x, y, z of the terrain frame."""
        self._x = (view.hand[0] if self._x is None else self._x) + 0.002 * self._speed
        (x, y, _), (vx, vy, _) = view.hand, view.hand_v
        along = _K * (self._x - x) + _B * (self._speed - vx)
        return along, -_ASIDE * y - 20.0 * vy, 0.0


def loads(found: str, true: str, share: float) -> SlidLoad:
    """Return the loads of the arm `true` while `share` of what was `found` is off."""
    motors = friction_of(tomllib.loads(true)["motors"])
    fit = friction_from_toml(found, "friction.toml").fit
    rest, sliding = [], []
    for speed in SPEEDS:
        known = known_friction(fit.friction, fit.deviation, fit.asymmetry_deviation)
        compensation = FrictionCompensation(CONSTANTS, known, share)
        bench = HoldBench(compensation=compensation, motors=motors, mass=MASS)
        stood, slid = put_down_and_slide(bench, speed)
        rest.append(stood)
        sliding.append(slid)
        assert bench.cycle.status.verdict is None
        assert compensation.swung_motor == 0
    return SlidLoad(float(np.mean(rest)), tuple(sliding))


def put_down_and_slide(bench: HoldBench, speed: float) -> tuple[float, float]:
    """Return how far F_n is from its weight at rest and while it slides [N]."""
    plant = bench.plant
    plant.terrain = make_terrain(
        GroundChoice("none", "tread"), 0.0, np.random.default_rng(1)
    )
    bench.enter(ArmState.FLOAT)
    plant.hand.put_down(plant.terrain.surface(0.0))
    forces(bench, _RESTS)
    stood = forces(bench, _STANDS)
    plant.hand = SlidingHand(speed)
    slid = forces(bench, min(_WAY / speed, _LONGEST))
    return float(stood.mean()) - _WEIGHT, float(slid[slid.size // 2 :].mean()) - _WEIGHT


def forces(bench: HoldBench, seconds: float) -> np.ndarray:
    """Let time pass; return the true F_n of every cycle [N]."""
    found = []
    for _ in range(round(500 * seconds)):
        bench.step()
        found.append(bench.plant.contact_force[2])
    return np.array(found)


def page_part(folders: Sequence[Path], found: dict[float, list[SlidLoad]]) -> str:
    """Return what stands in docs/friction.md."""
    head = ["compensated", "at rest", *(f"{1e3 * speed:g} mm/s" for speed in SPEEDS)]
    lines = [f"| {' | '.join(head)} |", "|" + "---|" * len(head)]
    for share, arms in found.items():
        columns = np.array([(arm.rest, *arm.sliding) for arm in arms]).T
        cells = [f"{np.mean(c):+.2f} ({np.abs(c).max():.2f})" for c in columns]
        lines.append(f"| {share:g} | {' | '.join(cells)} |")
    arms = "one arm" if len(folders) == 1 else f"{len(folders)} arms"
    return (
        "`python -m studies.friction_sliding FOLDER... --write docs/friction.md`: "
        f"{arms} with the whole friction, put down on a plate and slid. F_n less the "
        f"{_WEIGHT:.2f} N that were set [N]: mean (largest of the arms, without sign)."
        "\n\n" + "\n".join(lines) + f"\n\nThe goal while sliding is {MOST:g} N.\n"
    )


def main() -> int:
    """Measure, print, write; return 1 beyond the bound."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", type=Path, nargs="+")
    parser.add_argument("--write", type=Path, help="page whose part is written")
    given = parser.parse_args()
    names = "friction.fake.toml", "friction.truth.toml"
    found: dict[float, list[SlidLoad]] = {share: [] for share in SHARES}
    for folder in given.folders:
        texts = [(folder / name).read_text() for name in names]
        for share in SHARES:
            found[share].append(loads(*texts, share))
    part = page_part(given.folders, found)
    print(part)
    if given.write is not None:
        given.write.write_text(with_sliding(given.write.read_text(), part))
    compensated = [arm for share in SHARES if share for arm in found[share]]
    worst = max(abs(force) for arm in compensated for force in arm.sliding)
    return int(worst > MOST)


if __name__ == "__main__":
    sys.exit(main())
