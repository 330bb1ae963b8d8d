"""How near sound arms come to the limits on motion, and whether any is stopped.

python -m studies.motion_margins [--trials 6] [--stances 25] [--only TEXT]

Sessions on four terrains with three shares of friction and three paces, stances on
two terrains with two of them, and every calibration, through the whole program on a
simulated arm that nothing is wrong with. Of each limit in `control_loop.motion` the
largest share that was reached is kept. Exits with 1 where a sound arm was stopped, or
came nearer than half of a limit.
"""

import argparse
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from acquisition.control_loop import motion
from tests.experiments.program import traction

TERRAINS = ("S0", "TF", "S15", "B0")
FRICTIONS = (0.02, 0.4, 1.0)
# Beyond, friction alone holds a foot that is asked for 3 N: it never moves.
STANCE_FRICTIONS = (0.02, 0.4)
PACES = ("slow", "fast", "clumsy")
STANCES = ("S0", "TF")
CALIBRATIONS = ("gravity", "friction", "sensor", "foot")
WANTED = 2.0  # margin: the limit by the largest value


@dataclass(slots=True)
class Largest:
    """The largest share of each limit that was reached.

    Attributes:
        shares: of the limit, by what it is of.
        where: the command in which it was.
        now: the command that runs.
    """

    shares: dict[str, float] = field(default_factory=dict)
    where: dict[str, str] = field(default_factory=dict)
    now: str = ""

    def note(self, name: str, share: float) -> None:
        """Keep a share if it is the largest of its name."""
        if share > self.shares.get(name, 0.0):
            self.shares[name] = share
            self.where[name] = self.now


def watch_limits(patch: pytest.MonkeyPatch) -> Largest:
    """Return the largest shares of what the guard looks at while `patch` lasts."""
    largest = Largest()

    def noting(name: str) -> None:
        usual = getattr(motion, name)

        def compare(fault, value, limit):
            largest.note(f"{fault.value}: {name[1:]}", value / limit)
            return usual(fault, value, limit)

        patch.setattr(motion, name, compare)

    for name in ("_energy", "_speed", "_travel"):
        noting(name)
    usual = motion._first_beyond  # noqa: SLF001 - what the guard compares by

    def first_beyond(values, limits):
        pairs = zip(values, limits, strict=True)
        largest.note("speed of a joint", max(abs(v) / limit for v, limit in pairs))
        return usual(values, limits)

    patch.setattr(motion, "_first_beyond", first_beyond)
    return largest


def commands(trials: int, stances: int) -> Iterator[tuple[str, ...]]:
    """Return every command, without the folders."""
    for terrain in TERRAINS:
        for friction in FRICTIONS:
            for pace in PACES:
                asked = ("--trials", str(trials), "--pace", pace)
                yield "run", terrain, *asked, "--friction", str(friction)
    for terrain in STANCES:
        for friction in STANCE_FRICTIONS:
            asked = ("--policy", "constant-mu", "--stances", str(stances))
            asked = (*asked, "--trials", "2", "--friction", str(friction))
            yield "stance", terrain, *asked
    for kind in CALIBRATIONS:
        for friction in FRICTIONS:
            yield "calibrate", kind, "--force", "--friction", str(friction)


def run(command: tuple[str, ...], largest: Largest) -> str:
    """Run a command on a new simulated arm; return what it said of a stop."""
    largest.now = " ".join(command)
    with tempfile.TemporaryDirectory(prefix="margins-") as folder:
        common = ["--fake", "--fast", "--seed", "1", "--data", folder]
        if command[0] == "calibrate":
            common += ["--out", str(Path(folder, "out.toml"))]
        else:
            common += ["--operator-script", "auto"]
        done = traction(*command, *common)
    return done.err.strip() if done.code or done.err else ""


def main(tell: Callable[[str], object] = print) -> int:
    """Run everything, print the shares; return 1 where a sound arm was stopped."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=6)
    parser.add_argument("--stances", type=int, default=25)
    parser.add_argument("--only", default="")
    given = parser.parse_args()
    chosen = [
        command
        for command in commands(given.trials, given.stances)
        if given.only in " ".join(command)
    ]
    stopped = 0
    with pytest.MonkeyPatch.context() as patch:
        largest = watch_limits(patch)
        for command in chosen:
            said = run(command, largest)
            stopped += bool(said)
            tell(f"{' '.join(command)}: {said or 'nothing stopped it'}")
    tell("| limit | largest share reached | in |\n|---|---|---|")
    for name, share in sorted(largest.shares.items(), key=lambda row: -row[1]):
        tell(f"| {name} | {share:.2f} | {largest.where[name]} |")
    margin = 1.0 / max(largest.shares.values())
    tell(f"{len(chosen)} commands, {stopped} stopped, smallest margin {margin:.2f}")
    return int(stopped > 0 or margin < WANTED)


if __name__ == "__main__":
    sys.exit(main())
