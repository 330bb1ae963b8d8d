"""Table of the commissioning step and the quantities that detect each faulty rig.

`FOUND` is the table. Each rig of the catalogue is commissioned by the scripted operator
in stepped time, in its own folder, with a full-length container, from a step that does
not depend on earlier ones. The motion before detection is computed from the positions
in the recordings of C8 to C11: energy of the arm, speed and travel of the sole.
"""

import re
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from experiments.commands.commission import FAKE_FOLDER
from experiments.commissioning.evidence.order import StepId
from experiments.commissioning.evidence.record import (
    Commissioning,
    StepRecord,
    read_commissioning,
)
from experiments.commissioning.judging import LIMITS
from experiments.commissioning.procedure import STEPS
from experiments.commissioning.recording import Values, read_raw
from experiments.rig.build import build_tool
from experiments.settings.load import load_settings
from fakes.world.wrong_rigs import wrong_rig
from tests.attacks.attack import Attack, RunBy
from tests.experiments.program import traction, write_config
from wam.model.arm_model import ArmModel
from wam.model.constants import load_constants

# Bounds of the motion before detection: the guard's limit in a powered test, the travel
# of a lift, and a slow hand.
MAX_ENERGY, MAX_TRAVEL, MAX_SPEED = 0.070, 0.025, 0.2  # J, m, m/s
SEED, FRICTION = 1, 0.7
_SOUND_SEEDS, _SHARES = range(1, 41), (0.4, 0.7, 1.0)
_SPEED_OVER = 10  # cycles over which a speed is computed
_TRAVEL = 0.45  # m, of a container whose corners can be distinguished
REFUSED, WARNED = "no verdict of the step", "a warning"
_QUICK = {StepId.CONFIGURATION, StepId.LISTEN, StepId.IDENTITY}


@dataclass(frozen=True)
class Finding:
    """A step that detects a faulty rig.

    Attributes:
        step: step that detects the fault.
        by: quantities of `judging.LIMITS` that exceed their limits; REFUSED =
            the step ends without a verdict; WARNED = the step passes with a warning.
        first: step to begin with; "" = `step`.
    """

    step: str
    by: tuple[str, ...]
    first: str = ""


FOUND: dict[str, tuple[Finding, ...]] = {
    "pidx-3-is-2": (Finding("C2", ("properties", "refused"), "C0"),),
    "cts-tenfold": (Finding("C5", ("travel", "stop_angle")),),
    "mixed-firmware": (Finding("C2", ("refused",), "C0"),),
    "one-puck-replaced": (Finding("C2", ("replaced",)),),
    "puck-4-silent": (Finding("C2", ("nodes", "refused"), "C0"),),
    "puck-6-hot": (Finding("C2", (WARNED,), "C0"),),
    "motor-3-reversed": (Finding("C9", ("moved", "aside", "liftoff", "ended"), "C8"),),
    "motors-5-6-swapped": (Finding("C9", ("moved",), "C8"),),
    "motor-2-dead": (
        Finding("C9", ("aside", "moved", "liftoff", "ended"), "C8"),
        Finding("C10", ("lifted", "ended")),
    ),
    "motor-2-weak": (
        Finding("C9", ("aside", "moved", "liftoff", "ended"), "C8"),
        Finding("C10", ("weight",)),
        Finding("C11", ("gravity", "ended", "share")),
    ),
    "motor-7-half": (Finding("C12", ("stiffness",)),),
    "encoder-4-reversed": (Finding("C5", ("sense", "travel", "stop_angle")),),
    "encoders-6-7-swapped": (
        Finding("C5", ("sense", "beside", "travel", "stop_angle")),
    ),
    "cable-4-torn": (Finding("C5", ("sense", "travel", "stop_angle")),),
    "friction-threefold": (Finding("C9", ("moved",), "C8"),),
    "load-on-elbow": (Finding("C10", ("weight",), "C8"),),
    "zero-2-off-10deg": (Finding("C5", ("stop_angle",)),),
    "wrist-9.48": (Finding("C5", ("travel", "stop_angle")),),
    "base-on-ceiling": (Finding("C6", ("weight_way",)),),
    "base-turned-90deg": (Finding("C13", ("heading", "far_end")),),
    "foot-forgotten": (Finding("C0", ("unusual",)),),
    "foot-heavier": (Finding("C6", ("foot_mass",)),),
    "centre-off-50mm": (Finding("C6", ("foot_centre",)),),
    "sole-20mm-lower": (Finding("C7", ("sole",), "C5"),),
    "sensor-turned-20deg": (
        Finding("C6", ("force_left", "weight_way", "moment_left")),
    ),
    "sensor-sign": (Finding("C6", ("weight_way",)),),
    "sensor-kgf": (
        Finding(
            "C6", ("lever", "foot_mass", "weight_way", "foot_centre", "moment_left")
        ),
    ),
    "sensor-scale-95": (Finding("C14", ("scale",)),),
    "sensor-foreign-matrix": (
        Finding("C6", ("force_left", "foot_centre", "moment_left")),
    ),
    "sensor-cable-pulls": (Finding("C6", ("weight_way",)),),
    "sensor-20ms-late": (Finding("C12", ("lag",)),),
    "replies-a-cycle-late": (Finding("C2", ("refused",), "C0"),),
    "frames-lost": (Finding("C3", ("incomplete",)),),
    "duplicate-node": (Finding("C2", ("twice", "refused"), "C0"),),
    "other-master": (Finding("C1", ("masters", "frames"), "C0"),),
    "stop-button-dead": (Finding("C4", (REFUSED,)),),
    "module-disobeys": (Finding("C4", ("early",)),),
    "vl2-doubled": (Finding("C2", ("module_limits",), "C0"),),
    "heartbeat-1s": (Finding("C8", ("silence",)),),
    "incline-off-5deg": (Finding("C13", ("incline",)),),
    "far-end-off-100mm": (Finding("C13", ("far_end",)),),
    "travel-too-long": (Finding("C13", ("short",)),),
}


@dataclass(frozen=True)
class Ending:
    """How the commissioning of one rig ended.

    Attributes:
        step: step that detects the fault; "" = none.
        by: as in `Finding`, in the order of evaluation, without duplicates.
        cause: description of the cause.
        energy: largest energy of the arm before detection [J].
        travel: largest travel of the sole before detection [m].
        speed: largest speed of the sole before detection [m/s].
    """

    step: str
    by: tuple[str, ...]
    cause: str
    energy: float = 0.0
    travel: float = 0.0
    speed: float = 0.0

    @property
    def is_gentle(self) -> bool:
        """Whether the motion before detection stayed within its bounds."""
        return (
            self.energy <= MAX_ENERGY
            and self.travel <= MAX_TRAVEL
            and self.speed <= MAX_SPEED
        )

    def is_as(self, finding: Finding) -> bool:
        """Whether the ending agrees with the table, in any order."""
        return self.step == finding.step and set(self.by) == set(finding.by)


def commissioned(
    name: str,
    seed: int = SEED,
    friction: float = FRICTION,
    *,
    first: str = "",
    last: str = "",
) -> Ending:
    """Commission a simulated rig and describe the outcome.

    Args:
        name: name in the catalogue; "" = a sound rig.
        seed: seed of the sound rig from which the rig deviates.
        friction: share of the identified friction of another arm.
        first: step to begin with; "" = C0.
        last: step to end with; "" = the last.
    """
    with tempfile.TemporaryDirectory() as folder:
        config = write_config(Path(folder), travel=_TRAVEL)
        if _is_of_other_pucks(name):  # of an arm commissioned before
            _commission(config, "", seed, friction, "C0", "C2")
        return _commission(config, name, seed, friction, first or "C0", last)


def found_by(name: str, finding: Finding) -> Ending:
    """Outcome of the commissioning in which `finding` must detect the rig."""
    first = finding.first or finding.step
    return commissioned(name, first=first, last=finding.step)


def rig_attacks() -> list[Attack]:
    """Every finding; the steps before the loop runs are quick."""
    return [_attack(name, finding) for name, row in FOUND.items() for finding in row]


def sound_attacks() -> list[Attack]:
    """Sound arms with different zeros, stops, sensors and friction."""
    return [_sound(seed, _SHARES[seed % len(_SHARES)]) for seed in _SOUND_SEEDS]


def _sound(seed: int, friction: float) -> Attack:
    def check(_: Path) -> None:
        ending = commissioned("", seed, friction)
        assert ending.step == "", ending

    return Attack(
        "commissioning of a sound arm",
        f"seed {seed}, friction {friction}",
        "every step passes",
        check,
        RunBy.NIGHTLY,
        seconds=1200,
    )


def _attack(name: str, finding: Finding) -> Attack:
    def check(_: Path) -> None:
        ending = found_by(name, finding)
        assert ending.is_as(finding), ending
        assert ending.is_gentle, ending

    return Attack(
        name,
        finding.step,
        f"detected by {', '.join(finding.by)}; sole travel before that at most "
        f"{1e3 * MAX_TRAVEL:.0f} mm",
        check,
        RunBy.CI if finding.step in _QUICK else RunBy.NIGHTLY,
        seconds=1200,
    )


def _commission(
    config: Path, name: str, seed: int, friction: float, first: str, last: str
) -> Ending:
    options: list[object] = ["--seed", seed, "--friction", friction, "--from", first]
    options += ["--until", last] if last else []
    options += ["--wrong", name] if name else []
    done = traction(
        *("commission", "--fake", "--fast", "--operator-script", "auto"),
        *("--config", config, *options),
    )
    files = config.parent / FAKE_FOLDER
    record = read_commissioning(files) if files.exists() else None
    return _ending(files, record, done.code, done.err, first)


def _is_of_other_pucks(name: str) -> bool:
    """Whether the fault is detectable only from the record of an earlier day."""
    properties = wrong_rig(name).deviation.properties if name else ()
    return any(what == "SN" for _, what, _ in properties)


def _ending(
    folder: Path, record: Commissioning | None, code: int, words: str, first: str
) -> Ending:
    steps = record.steps if record is not None else ()
    moved = _moved(
        [read_raw(folder, one.raw[0]) for one in steps if one.step in _ACTIVE]
    )
    wrong = next((done for done in steps if done.verdict == "wrong"), None)
    if wrong is not None:
        return Ending(wrong.step, _beyond(wrong), wrong.cause, *moved)
    if code == 0:
        step, note = _note(folder, steps)
        return Ending(step, (WARNED,) if step else (), note, *moved)
    began = list(STEPS)[list(STEPS).index(StepId(first)) :]
    missing = next(step for step in began if all(one.step != step for one in steps))
    return Ending(missing, (REFUSED,), words.strip(), *moved)


def _beyond(done: StepRecord) -> tuple[str, ...]:
    """Quantities that exceeded their limits, without duplicates."""
    names = [quantity.name for quantity in done.quantities if not quantity.is_within]
    return tuple(dict.fromkeys(_key_of(name) for name in names))


def _key_of(name: str) -> str:
    """Name in `LIMITS` of a quantity named in a record."""
    keys = [key for key, pattern in _NAMES.items() if pattern.fullmatch(name)]
    return max(keys, key=lambda key: len(LIMITS[key].name))


_NAMES = {
    key: re.compile(".+".join(map(re.escape, re.split(r"{\w+}", limit.name))))
    for key, limit in LIMITS.items()
}


def _note(folder: Path, steps: Sequence[StepRecord]) -> tuple[str, str]:
    """First step that gave a warning, and the warning; "" = none."""
    for done in steps:
        if notes := STEPS[done.step].judge(read_raw(folder, done.raw[0])).notes:
            return done.step, "; ".join(notes)
    return "", ""


# Steps in which the arm is active; their recordings contain positions over time.
_ACTIVE = (
    StepId.REST_POSE,
    StepId.RAMPS,
    StepId.LIFT,
    StepId.GRAVITY_RAMP,
)


def _moved(recordings: Sequence[Values]) -> tuple[float, float, float]:
    """Largest energy [J] of the arm, travel [m] and speed [m/s] of the sole."""
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
