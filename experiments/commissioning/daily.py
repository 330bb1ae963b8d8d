"""Daily check: is the arm unchanged since its commissioning?

First bus, pucks and replies, then the foot's weight in four manually held poses: the
sensor's bias hides it in a single pose, and two readings differ by 6 degrees anyway.
The first activation of the day is without torque, the arm lying on its stops; then
joints 2 and 4 are lifted off. The torque they need reveals more about motors, cables
and drives than any test of an idle arm.
"""

from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.errors import SettingsError
from experiments.commissioning import rest_pose
from experiments.commissioning.bus import listen
from experiments.commissioning.evidence.daily_record import (
    DailyCheck,
    read_history,
    write_history,
)
from experiments.commissioning.evidence.gate import lacks, require
from experiments.commissioning.evidence.order import STEP_INPUTS, StepId
from experiments.commissioning.fits import angle, fit_foot, orientations
from experiments.commissioning.guide import RecordFolder
from experiments.commissioning.judging import (
    JudgedQuantity,
    Judgement,
    judge_quantity,
    judged,
)
from experiments.commissioning.recording import (
    Values,
    number,
    read_raw,
    words,
    write_raw,
)
from experiments.commissioning.scene import Scene
from experiments.commissioning.weights import POSES, bring, measure
from experiments.messages import preflight_error
from experiments.operator.console import BAD, GOOD
from experiments.preflight.zero import zero_errors
from experiments.rig.requests import MeasureExchange, StartArm
from wam.model.arm_model import ArmModel
from wam.model.constants import Array, load_constants

HANGING = (0, 2, 3, 4)  # indices of POSES: foot down, to both sides, ahead
LIFTED = (2, -4)  # joints, signed by the direction of the lift
_LISTENED = 2.0  # s, duration of silent listening
_DEVICES = ("pucks", "motors", "module", "sensor")  # keys of `STEP_INPUTS`
_REMEDY = (
    "Look at what is named. What changed for good is commissioned again, from the step "
    "that measures it: traction commission --from STEP."
)


def do_daily(
    scene: Scene, files: RecordFolder, operator: str, *, is_simulated: bool
) -> DailyCheck:
    """Run the daily check, write its result to the history and return it.

    Args:
        scene: the rig and the terminal.
        files: the commissioning to compare with.
        operator: name of the operator.
        is_simulated: whether the arm is simulated.

    Raises:
        SettingsError: the arm was not commissioned as far as C9.
        PreflightError: the arm is not fit, or a person did not follow a prompt.
        StopRequestedError, ArmFaultError: as `ConsoleLoop.tick`.
    """
    reference = reference_of(files)
    history = read_history(files.folder, is_simulated=is_simulated)
    started = _now(scene)
    values = collect(scene, files, reference)
    judgement = judge(values)
    ended = _now(scene)
    raw = write_raw(files.folder, f"daily_{ended:%Y%m%dT%H%M%S}.npz", values)
    check = DailyCheck(
        started=started,
        ended=ended,
        operator=operator,
        raw=raw,
        quantities=judgement.quantities,
        cause=judgement.cause,
    )
    write_history(files.folder, history.with_check(check))
    _say(scene, judgement)
    return check


def reference_of(files: RecordFolder) -> Values:
    """Return the reference values of the daily check from the commissioning.

    Raises:
        SettingsError: C6 or C9 was not done, or its recording is missing.
    """
    raws: dict[StepId, Values] = {}
    for step in (StepId.OWN_WEIGHT, StepId.RAMPS):
        done = files.record.of(step)
        if done is None or not done.raw or done.verdict == "wrong":
            raise SettingsError(
                f"{step} {step.words} was not passed: there is nothing to compare "
                "with.",
                hint=f"traction commission --from {step}. Nothing was started.",
            )
        raws[step] = read_raw(files.folder, done.raw[0])
    lifted = rest_pose.liftoffs(raws[StepId.RAMPS])
    return {
        "weight": fit_foot(raws[StepId.OWN_WEIGHT]).weight,
        "lifted": np.array([lifted[joint] for joint in LIFTED]),
    }


def collect(scene: Scene, files: RecordFolder, reference: Values) -> Values:
    """Record the daily check; a contradiction ends it before the activation.

    Raises:
        PreflightError, StopRequestedError, ArmFaultError: as `do_daily`.
    """
    scene.say("Daily check, about 2 min   [q]uit. The arm is idle: support it.")
    heard = _listen(scene)
    scene.rig.backend.ask(StartArm())
    times = scene.rig.backend.ask(MeasureExchange())
    scene.start()
    assert scene.info is not None
    changed = _changed(files, scene.inputs())
    if scene.simulation is None:
        require(lacks(files.record, scene.inputs(), _now(scene)))
    if not scene.info.is_zeroed:
        raise preflight_error("not-zeroed")
    zero = zero_errors(scene.rig, scene.info)
    held = _hang(scene, reference)
    values: dict[str, NDArray[Any]] = {
        **{f"heard_{name}": value for name, value in heard.items()},
        "replies_ns": np.array(times.replies_ns, dtype=np.int64),
        "unasked": np.array(times.unasked),
        "late": np.array(times.late),
        "answer_ns": np.array(times.answer_ns),
        "changed": np.array(changed, dtype=np.str_),
        "zero": np.zeros(0) if zero is None else zero,
        **held,
        **{f"reference_{name}": value for name, value in reference.items()},
    }
    if judge(values).cause:
        return values  # nothing is activated after a contradiction
    rest = rest_pose.rest(scene)
    values |= {f"rest_{name}": value for name, value in rest.items()}
    if not rest_pose.judge_rest(rest).cause:
        ramps = rest_pose.ramps(scene, LIFTED)
        values |= {f"ramp_{name}": value for name, value in ramps.items()}
    return values


def _listen(scene: Scene) -> Values:
    values: Values = {}
    for share, values in listen(scene.rig, _LISTENED):  # noqa: B007
        scene.show_share(share, "listening, nothing is sent")
    return values


def _hang(scene: Scene, reference: Values) -> Values:
    """Have the foot held in four poses; returns joints, readings and settings.

    The sensor's drift alone looks like another weight on one day in thirty: poses
    that do not fit are repeated, and all eight are judged together.
    """
    payload = scene.rig.payload
    believed = {"sign": np.array(payload.sign), "mounting": payload.rotation}
    believed["reference_weight"] = reference["weight"]
    parts: list[tuple[Array, Array]] = []
    for is_again in (False, True):
        if is_again:
            scene.say("The foot's weight differs from the commissioning's: once more.")
        for k, at in enumerate(HANGING, 1):
            bring(scene, POSES[at], f"pose {k} of {len(HANGING)}")
            parts.append(measure(scene))
        held = {
            "q": np.array([q for q, _ in parts]),
            "readings": np.array([reading for _, reading in parts]),
            **believed,
        }
        if all(row.measured.is_within for row in _hanging_rows(held)):
            break
    return held


def judge(values: Values) -> Judgement:
    """Judge a recording of `collect`: bus and devices, pose, rest, lift-off."""
    changed, replies = words(values, "changed"), values["replies_ns"]
    master = int(number(values, "heard_master"))
    rows = [
        judge_quantity("masters", int(master >= 0), id=max(master, 0)),
        judge_quantity("error_frames", number(values, "heard_error_frames")),
        judge_quantity("frames", number(values, "heard_frames")),
        judge_quantity("changed", len(changed), text=", ".join(changed)),
        judge_quantity("answered", number(values, "unasked")),
        judge_quantity("late", number(values, "late")),
        judge_quantity("answer", number(values, "answer_ns") / 1e6),
        judge_quantity(
            "exchange", float(np.median(replies)) / 1e6 if len(replies) else 99.0
        ),
    ]
    if values["zero"].size:
        rows.append(judge_quantity("zero", np.degrees(np.abs(values["zero"]).max())))
    rows += [*_hanging_rows(values), *_lying_rows(values)]
    return judged(rows)


def _hanging_rows(values: Values) -> list[JudgedQuantity]:
    """Judge the foot's weight compared with the one that C6 fitted.

    The sensor's bias changes from day to day: it is fitted over the poses.
    """
    weight = values["reference_weight"]
    R = orientations(values, ArmModel(load_constants()))
    loads = number(values, "sign") * values["readings"][:, :3]
    residuals = loads - R.transpose(0, 2, 1) @ weight
    residuals = residuals - residuals.mean(axis=0)
    degrees = residuals.size - residuals.shape[1]  # of freedom
    return [
        judge_quantity("hang_force", float(np.sqrt((residuals**2).sum() / degrees))),
        judge_quantity("hang_way", angle(fit_foot(values).weight, weight)),
    ]


def _lying_rows(values: Values) -> list[JudgedQuantity]:
    rest, ramp = _part(values, "rest_"), _part(values, "ramp_")
    if not rest:
        return []
    rows = rest_pose.rest_rows(rest)
    if not ramp:
        return rows
    rows += rest_pose.ramp_rows(ramp)
    if not all(row.measured.is_within for row in rows):
        return rows  # nothing was lifted off
    lifted = rest_pose.liftoffs(ramp)
    pairs = zip(LIFTED, values["reference_lifted"].tolist(), strict=True)
    drifts = [
        judge_quantity("drift", lifted.get(joint, 0.0) / before, joint=abs(joint))
        for joint, before in pairs
    ]
    return [*rows, *drifts]


def _part(values: Values, prefix: str) -> Values:
    return {
        name.removeprefix(prefix): value
        for name, value in values.items()
        if name.startswith(prefix)
    }


def _changed(files: RecordFolder, present: Mapping[str, str]) -> list[str]:
    """Describe the devices whose identity has changed since the commissioning."""
    return [
        STEP_INPUTS[name].words
        for name in _DEVICES
        if any(
            name in present and done.inputs.get(name, present[name]) != present[name]
            for done in files.record.steps
        )
    ]


def _say(scene: Scene, judgement: Judgement) -> None:
    """Print the judgement, a line per quantity, with the remedy of a failure."""
    scene.console.end_panel()
    for quantity in judgement.quantities:
        if quantity.name.startswith(_SHOWN) or not quantity.is_within:
            mark = GOOD if quantity.is_within else BAD
            scene.console.check(mark, "daily", quantity.text)
    if judgement.cause:
        scene.console.check(BAD, "daily check", judgement.cause)
        scene.console.say(f"   {_REMEDY}")
    else:
        scene.console.check(GOOD, "daily check", "the arm is as it was commissioned")


_SHOWN = ("response time", "time until seven", "zero", "weight", "lift-off")


def _now(scene: Scene) -> datetime:
    seconds = scene.rig.clock.utc_ns() // 1_000_000_000
    return datetime.fromtimestamp(seconds, UTC)
