"""Which step of `traction commission` finds which wrong rig, by the command itself.

python -m tests.wrong_rigs [NAME ...] [--seeds 1,2,3] [--friction 0.4,0.7,1.0]
python -m tests.wrong_rigs sound --seeds 1-40 --until C7
python -m tests.wrong_rigs --short

Each rig of the catalogue is commissioned by the scripted operator in stepped time, in
a folder of its own, beside a container of full length. It begins with the first step
that can see what is wrong, after those that the sound rig of the same seed passed. What
it did before it was found is read from the recordings of C8 to C11: energy of the arm,
speed and travel of the sole, by the positions as believed.

`--keep FILE` writes each ending into a table and passes over those that stand there, so
that a catalogue that takes hours can be gone on with.
"""

import argparse
import csv
import shutil
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cache
from pathlib import Path

import numpy as np

from experiments.commands.commission import FAKE_FOLDER
from experiments.commissioning.record import (
    Commissioning,
    StepRecord,
    read_commissioning,
    write_commissioning,
)
from experiments.commissioning.steps import ORDER, ProofStep
from experiments.proving.recording import Values, read_raw
from experiments.proving.work import WORK
from experiments.rig.build import build_tool
from experiments.settings.load import load_settings
from fakes.world.departure import Departure
from fakes.world.wrong_rigs import catalogue, wrong_rig
from tests.experiments.program import traction, write_config
from wam.model.arm_model import ArmModel
from wam.model.constants import load_constants

HEAD = f"{'rig':24} {'class':12} {'seed':>4} {'fr.':>4} {'found':>6}  " + (
    f"{'mJ':>5} {'mm':>4} {'m/s':>5}  cause"
)
_SPEED_OVER = 10  # cycles, over which a speed is taken
_TRAVEL = 0.45  # m, of a container whose corners can be told apart


@dataclass(frozen=True)
class Ending:
    """How the commissioning of one rig ended.

    Attributes:
        step: that found it; "" = none.
        cause: in words.
        is_refused: the step ended without a judgement: the rig was refused.
        is_warned: the step only warned of it, and was passed.
        energy: largest of the arm before that [J].
        travel: of the sole before that [m].
        speed: largest of the sole before that [m/s].
    """

    step: str
    cause: str
    is_refused: bool = False
    is_warned: bool = False
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
        first: step to begin with; "" = the first that `name` can touch, after those of
            the sound rig of `seed`.
        last: step to end with; "" = the last.
    """
    with tempfile.TemporaryDirectory() as folder:
        begin = first
        if name and not first and _first_touched(name) is not ProofStep.CONFIGURATION:
            begin = _first_touched(name)
            before = ORDER[: ORDER.index(begin)]
            _take_sound(seed, friction, before, Path(folder))
        elif name and _is_of_other_pucks(name):
            begin = ProofStep.IDENTITY  # of an arm that was commissioned
            _take_sound(seed, friction, ORDER, Path(folder))
        return _commission(Path(folder), name, seed, friction, begin, last)


def _commission(
    folder: Path, name: str, seed: int, friction: float, first: str, last: str
) -> Ending:
    """Commission a simulated rig in `folder`, as `commissioned`."""
    options: list[object] = ["--seed", seed, "--friction", friction]
    options += ["--from", first] if first else []
    options += ["--until", last] if last else []
    options += ["--wrong", name] if name else []
    config = write_config(folder, travel=_TRAVEL)
    done = traction(
        *("commission", "--fake", "--fast", "--operator-script", "auto"),
        *("--config", config, *options),
    )
    files = folder / FAKE_FOLDER
    record = read_commissioning(files) if files.exists() else None
    return _ending(files, record, done.code, done.err, first)


def _first_touched(name: str) -> ProofStep:
    """Return the first step that what is wrong can change anything of.

    C5, C8 and C13 begin on a rig of their own: nothing of what came before is missed.
    What only the sensor tells begins at C6, with another draw of its noise.
    """
    rig, sound = wrong_rig(name).departure, Departure()
    differs = {
        field.name
        for field in fields(Departure)
        if not np.array_equal(getattr(rig, field.name), getattr(sound, field.name))
    }
    for step, of_step in reversed(_TOUCHED.items()):
        if differs <= of_step:
            return step
    return ProofStep.CONFIGURATION


_PLACES = frozenset({"place"})
_TORQUES = _PLACES | {"torque"}
_LOADS = _TORQUES | {
    *("shown", "force_late", "cable"),
    *("foot_mass", "foot_centre", "sole", "is_foot_turned"),
}
_POSES = _LOADS | {*("zeros", "stops", "ratios", "mount", "links"), "counts", "torn"}
_TOUCHED = {  # fields of `Departure` that no step before can see
    ProofStep.BY_HAND: _POSES | {"friction"},
    ProofStep.OWN_WEIGHT: _LOADS,
    ProofStep.REST_POSE: _TORQUES,
    ProofStep.CONTAINER: _PLACES,
}


@cache
def _sound_folder(seed: int, friction: float) -> tempfile.TemporaryDirectory[str]:
    """Return the folder of a sound rig that passed C0 to C11."""
    folder = tempfile.TemporaryDirectory()
    ending = _commission(Path(folder.name), "", seed, friction, "", "C11")
    assert not ending.step, ending
    return folder


def _take_sound(
    seed: int, friction: float, steps: Sequence[ProofStep], folder: Path
) -> None:
    """Put what the sound rig of `seed` passed of these steps into `folder`."""
    sound = Path(_sound_folder(seed, friction).name) / FAKE_FOLDER
    shutil.copytree(sound, folder / FAKE_FOLDER)
    record = read_commissioning(sound)
    assert record is not None
    taken = tuple(done for done in record.steps if done.step in steps)
    kept = record.model_copy(update={"steps": taken})
    write_commissioning(folder / FAKE_FOLDER, kept)


def _is_of_other_pucks(name: str) -> bool:
    """Return whether only the record of a former day can tell what is wrong."""
    return any(what == "SN" for _, what, _ in wrong_rig(name).departure.properties)


def _ending(
    folder: Path, record: Commissioning | None, code: int, words: str, first: str
) -> Ending:
    steps = record.steps if record is not None else ()
    moved = [read_raw(folder, done.raw[0]) for done in steps if done.step in _ACTIVE]
    energy, travel, speed = _moved(moved)
    wrong = next((done for done in steps if done.verdict == "wrong"), None)
    if wrong is not None:
        return Ending(wrong.step, wrong.cause, False, False, energy, travel, speed)
    if code == 0:
        step, note = _note(folder, steps)
        return Ending(step, note, False, bool(step), energy, travel, speed)
    began = list(WORK)[list(WORK).index(ProofStep(first)) if first else 0 :]
    missing = next(step for step in began if all(one.step != step for one in steps))
    return Ending(missing, words.strip(), True, False, energy, travel, speed)


def _note(folder: Path, steps: Sequence[StepRecord]) -> tuple[str, str]:
    """Return the first step that warned of something, and of what; "" = none."""
    for done in steps:
        if notes := WORK[done.step].judge(read_raw(folder, done.raw[0])).notes:
            return done.step, "; ".join(notes)
    return "", ""


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


COLUMNS = ("name", "seed", "friction", "step", "how", "mJ", "mm", "m/s", "cause")
_HOW = {(False, False): "stopped", (True, False): "refused", (False, True): "warned"}
Run = tuple[str, int, float]  # name, "" = sound; seed; share of friction


def read_kept(path: Path) -> dict[Run, Ending]:
    """Return the endings that stand in a table of `--keep`; {} = there is none yet."""
    if not path.exists():
        return {}
    with path.open(newline="") as file:
        return {
            (row["name"], int(row["seed"]), float(row["friction"])): Ending(
                row["step"],
                row["cause"],
                row["how"] == "refused",
                row["how"] == "warned",
                float(row["mJ"]) / 1e3,
                float(row["mm"]) / 1e3,
                float(row["m/s"]),
            )
            for row in csv.DictReader(file)
        }


def _keep(path: Path, run: Run, ending: Ending) -> None:
    """Write an ending below the others."""
    is_new = not path.exists()
    with path.open("a", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        if is_new:
            writer.writerow(COLUMNS)
        moved = [f"{1e3 * ending.energy:.1f}", f"{1e3 * ending.travel:.1f}"]
        cause = ending.cause.splitlines()[0] if ending.cause else ""
        how = (ending.step, _HOW[ending.is_refused, ending.is_warned])
        writer.writerow([*run, *how, *moved, f"{ending.speed:.3f}", cause])


def _numbers(text: str) -> list[int]:
    """Return the seeds of "1,2,3" or "1-40"."""
    numbers: list[int] = []
    for word in text.split(","):
        first, _, last = word.partition("-")
        numbers += range(int(first), int(last or first) + 1)
    return numbers


# A short form: of every step without hands that takes long, what it has to find.
SHORT = (
    *(("foot-typed-4.5kg", "", "C0"), ("other-master", "", "C1"), ("poller", "", "C1")),
    *(("pidx-3-is-2", "", "C2"), ("mt-700", "", "C2"), ("mixed-firmware", "", "C2")),
    *(("duplicate-node", "", "C2"), ("vl2-doubled", "", "C2")),
    *(("replies-a-cycle-late", "C3", "C3"), ("stop-button-dead", "C4", "C4")),
    *(("module-disobeys", "C4", "C4"), ("motor-3-reversed", "C8", "C9")),
    *(("motors-5-6-swapped", "C8", "C9"), ("motor-2-dead", "C8", "C9")),
    *(("base-on-ceiling", "C8", "C8"), ("sensor-20ms-late", "C12", "C12")),
)


@dataclass(frozen=True)
class Asked:
    """A rig that is to be commissioned.

    Attributes:
        run: name, seed, share of friction.
        first: step to begin with; "" = the first that can see it.
        last: step to end with; "" = the last.
    """

    run: Run
    first: str
    last: str


def _asked(args: argparse.Namespace) -> list[Asked]:
    """Return what is asked for: all rigs of one seed, then those of the next."""
    shares = [float(word) for word in args.friction.split(",")]
    if args.short:
        return [Asked((name, 1, shares[0]), *span) for name, *span in SHORT]
    names = ["" if name == "sound" else name for name in args.names]
    return [
        Asked((name, seed, shares[number % len(shares)]), args.first, args.last)
        for number, seed in enumerate(_numbers(args.seeds))
        for name in names or list(catalogue())
    ]


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a line for every rig and the sum; return the exit code.

    1 = a sound rig was stopped, or a wrong one of `--short` was not found as listed.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help="of the catalogue, or sound (all)")
    parser.add_argument("--seeds", default="1", help="of the sound rigs: 1,2,3 or 1-40")
    parser.add_argument("--friction", default="0.7", help="shares, one for each seed")
    parser.add_argument("--from", dest="first", default="", help="first step")
    parser.add_argument("--until", dest="last", default="", help="last step")
    parser.add_argument("--short", action="store_true", help="a few rigs, two minutes")
    parser.add_argument("--keep", type=Path, help="table that is gone on with")
    args = parser.parse_args(arguments)
    for name in args.names:
        if name != "sound":
            wrong_rig(name)
    say = sys.stdout.write
    say(f"{HEAD}\n")
    known = read_kept(args.keep) if args.keep else {}
    found = as_listed = stopped = 0
    asked = _asked(args)
    for each in asked:
        name, seed, share = each.run
        ending = known.get(each.run)
        if ending is None:
            ending = commissioned(*each.run, first=each.first, last=each.last)
            if args.keep:
                _keep(args.keep, each.run, ending)
        say(f"{ending.row(name, seed, share)}\n")
        sys.stdout.flush()
        stopped += not name and bool(ending.step)
        found += bool(name) and bool(ending.step)
        as_listed += bool(name) and ending.step in wrong_rig(name).steps
    wrong = sum(bool(each.run[0]) for each in asked)
    say(
        f"{found} of {wrong} wrong rigs found, {as_listed} at a step of the catalogue\n"
    )
    say(f"{stopped} of {len(asked) - wrong} sound rigs stopped\n")
    return 1 if stopped or (args.short and as_listed < wrong) else 0


if __name__ == "__main__":
    sys.exit(main())
