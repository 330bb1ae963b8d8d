"""Which step of `traction commission` finds which wrong rig, by the command itself.

python -m tests.wrong_rigs [NAME ...] [--seeds 1,2,3] [--friction 0.4,0.7,1.0]

Each rig of the catalogue is commissioned by the scripted operator in stepped time, in
a folder of its own. What it did before it was found is read from the recordings of C8
to C11: energy of the arm, speed and travel of the sole, by the positions as believed.
"""

import argparse
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from experiments.commands.commission import FAKE_FOLDER
from experiments.commissioning.record import Commissioning, read_commissioning
from experiments.commissioning.steps import ProofStep
from experiments.proving.recording import Values, read_raw
from experiments.proving.work import WORK
from experiments.rig.build import build_tool
from experiments.settings.load import load_settings
from fakes.world.wrong_rigs import catalogue, wrong_rig
from tests.experiments.program import traction, write_config
from wam.model.arm_model import ArmModel
from wam.model.constants import load_constants

HEAD = f"{'rig':24} {'class':12} {'seed':>4} {'fr.':>4} {'found':>6}  " + (
    f"{'mJ':>5} {'mm':>4} {'m/s':>5}  cause"
)
_SPEED_OVER = 10  # cycles, over which a speed is taken


@dataclass(frozen=True)
class Ending:
    """How the commissioning of one rig ended.

    Attributes:
        step: that found it; "" = none.
        cause: in words.
        is_refused: the step ended without a judgement: the rig was refused.
        energy: largest of the arm before that [J].
        travel: of the sole before that [m].
        speed: largest of the sole before that [m/s].
    """

    step: str
    cause: str
    is_refused: bool = False
    energy: float = 0.0
    travel: float = 0.0
    speed: float = 0.0

    def row(self, name: str, seed: int, friction: float) -> str:
        """Return it as a line below `HEAD`; "sound" is the name of a sound rig."""
        kind = wrong_rig(name).kind.value if name else "sound"
        moved = f"{1e3 * self.energy:5.0f} {1e3 * self.travel:4.0f} {self.speed:5.2f}"
        where = self.step or "passed"
        cause = self.cause.splitlines()[0] if self.cause else ""
        return (
            f"{name or 'sound':24} {kind:12} {seed:4} {friction:4.1f} {where:>6}  "
            f"{moved}  {cause}"
        )


def commissioned(
    name: str, seed: int, friction: float, *, first: str = "", last: str = ""
) -> Ending:
    """Commission a simulated rig; return which step found what.

    Args:
        name: of the catalogue; "" = a sound rig.
        seed: of the sound rig that it departs from.
        friction: share of another arm's.
        first: step to begin with; "" = the first.
        last: step to end with; "" = the last.
    """
    options: list[object] = ["--seed", seed, "--friction", friction]
    options += ["--from", first] if first else []
    options += ["--until", last] if last else []
    options += ["--wrong", name] if name else []
    with tempfile.TemporaryDirectory() as folder:
        config = write_config(Path(folder))
        done = traction(
            *("commission", "--fake", "--fast", "--operator-script", "auto"),
            *("--config", config, *options),
        )
        kept = Path(folder) / FAKE_FOLDER
        record = read_commissioning(kept) if kept.exists() else None
        return _ending(kept, record, done.code, done.err, first)


def _ending(
    folder: Path, record: Commissioning | None, code: int, words: str, first: str
) -> Ending:
    steps = record.steps if record is not None else ()
    moved = [read_raw(folder, done.raw[0]) for done in steps if done.step in _ACTIVE]
    energy, travel, speed = _moved(moved)
    wrong = next((done for done in steps if done.verdict == "wrong"), None)
    if wrong is not None:
        return Ending(wrong.step, wrong.cause, False, energy, travel, speed)
    if code == 0:
        return Ending("", "", False, energy, travel, speed)
    began = list(WORK)[list(WORK).index(ProofStep(first)) if first else 0 :]
    missing = next(step for step in began if all(one.step != step for one in steps))
    return Ending(missing, words.strip(), True, energy, travel, speed)


# Steps in which the arm is active; their recordings hold positions in time.
_ACTIVE = (
    ProofStep.REST_POSE,
    ProofStep.RAMPS,
    ProofStep.LIFT,
    ProofStep.GRAVITY_RAMP,
)


def _moved(recordings: Sequence[Values]) -> tuple[float, float, float]:
    """Return largest energy [J], travel [m] and speed [m/s] of the sole."""
    constants = load_constants()
    model = ArmModel(constants, build_tool(load_settings(None).rig, "tread"))
    energy = travel = speed = 0.0
    for values in recordings:
        q, t = values["q"], values["t_ns"] * 1e-9
        if len(q) <= _SPEED_OVER:
            continue
        span = (t[_SPEED_OVER:] - t[:-_SPEED_OVER])[:, None]
        qd = (q[_SPEED_OVER:] - q[:-_SPEED_OVER]) / span
        at = q[_SPEED_OVER:]
        fastest = np.argsort(np.abs(qd).max(axis=1))[-20:]
        energy = max(energy, *(model.kinetic_energy(at[i], qd[i]) for i in fastest))
        soles = np.array([model.sole_pose(row)[0] for row in q[::5]])
        travel = max(travel, float(np.linalg.norm(soles - soles[0], axis=1).max()))
        rates = (model.sole_jacobian(at[i])[:3] @ qd[i] for i in fastest)
        speed = max(speed, *(float(np.linalg.norm(rate)) for rate in rates))
    return energy, travel, speed


def _rows(args: argparse.Namespace) -> Iterator[tuple[str, int, float, Ending]]:
    seeds = [int(word) for word in args.seeds.split(",")]
    shares = [float(word) for word in args.friction.split(",")]
    names = ["" if name == "sound" else name for name in args.names]
    for name in names or list(catalogue()):
        for number, seed in enumerate(seeds):
            share = shares[number % len(shares)]
            yield (
                name,
                seed,
                share,
                commissioned(name, seed, share, first=args.first, last=args.last),
            )


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a line for every rig and the sum; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help="of the catalogue, or sound (all)")
    parser.add_argument("--seeds", default="1", help="of the sound rigs, with commas")
    parser.add_argument("--friction", default="0.7", help="shares, one for each seed")
    parser.add_argument("--from", dest="first", default="", help="first step")
    parser.add_argument("--until", dest="last", default="", help="last step")
    args = parser.parse_args(arguments)
    for name in args.names:
        if name != "sound":
            wrong_rig(name)
    say = sys.stdout.write
    say(f"{HEAD}\n")
    found = as_listed = total = 0
    for name, seed, share, ending in _rows(args):
        say(f"{ending.row(name, seed, share)}\n")
        sys.stdout.flush()
        total += 1
        found += bool(ending.step)
        as_listed += bool(name) and ending.step in wrong_rig(name).steps
    say(f"{found} of {total} found, {as_listed} at a step that the catalogue names\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
