"""Each step: how it is collected, how it is judged, and what to do if it fails."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

from experiments.commissioning.steps import ProofStep
from experiments.proving import (
    bus,
    by_hand,
    configuration,
    container,
    lock_clock,
    rest_pose,
    scales,
    stop_circuit,
    weights,
)
from experiments.proving.limits import Judgement
from experiments.proving.recording import Values
from experiments.proving.scene import Scene
from experiments.rig.rig import Rig


@dataclass(frozen=True, slots=True)
class StepWork:
    """One step.

    Attributes:
        collect: returns what was recorded.
        judge: returns what came of that; it looks at nothing else.
        needs_loop: the loop runs, the arm is zeroed or not.
        minutes: it takes about so long.
        way_back: what to do where it fails.
        needs_proof: the arm is driven in the open: steps C0 to C11 have to count.
    """

    collect: Callable[[Scene], Values]
    judge: Callable[[Values], Judgement]
    minutes: float
    way_back: str
    needs_loop: bool = False
    needs_zero: bool = False
    needs_proof: bool = False


def _shown(
    work: Callable[[Rig], Iterator[tuple[float, Values]]], what: str
) -> Callable[[Scene], Values]:
    def collect(scene: Scene) -> Values:
        values: Values = {}
        for share, values in work(scene.rig):  # noqa: B007
            scene.show_share(share, what)
            if scene.console_loop.stop.count:
                break
        return values

    return collect


def _identify(scene: Scene) -> Values:
    values = bus.identify(scene.rig, scene.serials)
    scene.answers = scene.rig.backend.arm.answers()
    return values


def _time(scene: Scene) -> Values:
    if scene.info is None:
        scene.info = scene.rig.backend.start_arm()
        scene.answers = scene.rig.backend.arm.answers()
    return _shown(bus.time_replies, "the loop runs, the arm idle")(scene)


WORK: Mapping[ProofStep, StepWork] = {
    ProofStep.CONFIGURATION: StepWork(
        lambda scene: configuration.collect(scene.rig),
        configuration.judge,
        1,
        "Correct the file, or measure again what it says.",
    ),
    ProofStep.LISTEN: StepWork(
        _shown(bus.listen, "listening, nothing is sent"),
        bus.judge_silence,
        1,
        "End the other program; look at cable, terminators and bit rate.",
    ),
    ProofStep.IDENTITY: StepWork(
        _identify,
        bus.judge_identity,
        1,
        "Is this the arm and the puck it should be? What is right as it is goes into "
        "the file that [arm] properties of rig.toml names. Where a puck was replaced, "
        "move commissioning.json away: every step is done again.",
    ),
    ProofStep.TIMING: StepWork(
        _time,
        bus.judge_timing,
        2,
        "Use another adapter or computer, and end other programs on the bus.",
    ),
    ProofStep.STOP_CIRCUIT: StepWork(
        stop_circuit.collect,
        stop_circuit.judge,
        5,
        "Do not go on without a stop that works: pendant, its cable, the module.",
        needs_loop=True,
    ),
    ProofStep.BY_HAND: StepWork(
        by_hand.collect,
        by_hand.judge,
        10,
        "Zero the arm again at home; look at the encoder that is named.",
        needs_loop=True,
        needs_zero=True,
    ),
    ProofStep.OWN_WEIGHT: StepWork(
        weights.own_weight,
        weights.judge_own_weight,
        8,
        "Weigh the foot; look at the sensor's mounting, sign, sheet and cable.",
        needs_loop=True,
        needs_zero=True,
    ),
    ProofStep.HUNG_WEIGHT: StepWork(
        weights.hung_weight,
        weights.judge_hung_weight,
        12,
        "Zero the arm again where a zero is named; look at base and sensor.",
        needs_loop=True,
        needs_zero=True,
    ),
    ProofStep.REST_POSE: StepWork(
        rest_pose.rest_and_silence,
        rest_pose.judge_rest,
        5,
        "Lay the arm down again with nothing leaning on it; look at the mounting.",
        needs_loop=True,
        needs_zero=True,
    ),
    ProofStep.RAMPS: StepWork(
        rest_pose.ramps,
        rest_pose.judge_ramps,
        2,
        "Switch the arm off and look at the motor that is named, and its cables.",
        needs_loop=True,
        needs_zero=True,
    ),
    ProofStep.LIFT: StepWork(
        rest_pose.lift,
        rest_pose.judge_lift,
        2,
        "Weigh the foot; look at the zero position and at the drive cables.",
        needs_loop=True,
        needs_zero=True,
    ),
    ProofStep.GRAVITY_RAMP: StepWork(
        rest_pose.gravity_ramp,
        rest_pose.judge_gravity_ramp,
        1,
        "Weigh the foot; look at mounting, zero position and gravity calibration.",
        needs_loop=True,
        needs_zero=True,
    ),
    ProofStep.LOCK_AND_CLOCK: StepWork(
        lock_clock.collect,
        lock_clock.judge,
        4,
        "Look at the sensor's buffer and filter, at motor 7, and at lock_kp, lock_kd.",
        needs_loop=True,
        needs_zero=True,
        needs_proof=True,
    ),
    ProofStep.CONTAINER: StepWork(
        container.collect,
        container.judge,
        5,
        "Correct the terrain's row of the matrix, or put the container where it says.",
        needs_loop=True,
        needs_zero=True,
        needs_proof=True,
    ),
    ProofStep.PLATE: StepWork(
        scales.collect,
        scales.judge,
        5,
        "Read the scale again; compare the sensor's calibration sheet.",
        needs_loop=True,
        needs_zero=True,
    ),
}
# Steps that share one connection to the rig. A stop takes power and positions away.
SITTINGS: tuple[tuple[ProofStep, ...], ...] = (
    (ProofStep.CONFIGURATION, ProofStep.LISTEN, ProofStep.IDENTITY, ProofStep.TIMING),
    (ProofStep.STOP_CIRCUIT,),
    (ProofStep.BY_HAND, ProofStep.OWN_WEIGHT, ProofStep.HUNG_WEIGHT),
    (ProofStep.REST_POSE, ProofStep.RAMPS, ProofStep.LIFT, ProofStep.GRAVITY_RAMP),
    (ProofStep.LOCK_AND_CLOCK,),
    (ProofStep.CONTAINER,),
    (ProofStep.PLATE,),
)
