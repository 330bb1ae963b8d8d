"""Execution of the steps: collect, judge, write the record after each."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from experiments import provenance
from experiments.commissioning import bus, manual_joints
from experiments.commissioning.evidence.gate import lacks, require
from experiments.commissioning.evidence.inputs import inputs_of
from experiments.commissioning.evidence.order import StepId
from experiments.commissioning.evidence.record import (
    Commissioning,
    Measured,
    StepRecord,
    read_commissioning,
    write_commissioning,
)
from experiments.commissioning.judging import Judgement
from experiments.commissioning.procedure import STEPS
from experiments.commissioning.recording import read_raw, write_raw
from experiments.commissioning.scene import Scene
from experiments.commissioning.step import Step
from experiments.messages import preflight_error
from experiments.operator.console import BAD, GOOD, WARNING, Console
from experiments.rig.rig import Rig

SHOWN = 4  # quantities of a passed step on the screen


@dataclass(slots=True)
class RecordFolder:
    """Folder of the commissioning of one arm: record and recordings.

    Attributes:
        folder: path of the folder.
        record: present content of commissioning.json.
    """

    folder: Path
    record: Commissioning

    @classmethod
    def open(cls, folder: Path, *, is_simulated: bool) -> "RecordFolder":
        """Open the record in `folder`, or an empty one.

        Raises:
            SettingsError: the record is invalid or was changed.
        """
        record = read_commissioning(folder)
        if record is None:
            software = provenance.collect()["software"]
            record = Commissioning(program=software, is_simulated=is_simulated)
        return cls(folder, record)

    def keep(self, done: StepRecord) -> None:
        """Insert or replace a step and write the record."""
        self.record = self.record.with_step(done)
        write_commissioning(self.folder, self.record)

    def report_change(self, name: str, when: datetime) -> None:
        """Write that a person reported a change of an input of `order.STEP_INPUTS`."""
        self.record = self.record.with_reported_change(name, when)
        write_commissioning(self.folder, self.record)


def do_step(scene: Scene, step: Step, files: RecordFolder, operator: str) -> Judgement:
    """Run one step and write its record.

    Args:
        scene: the rig and the terminal.
        step: the step.
        files: the record.
        operator: name of the operator.

    Raises:
        PreflightError: the arm is not fit, or a person did not follow a prompt.
        StopRequestedError: as `ConsoleLoop.tick`.
    """
    scene.say("")
    title = f"{step.id} {step.id.words}, about {step.minutes:g} min"
    scene.say(f"{title}   [q]uit, to go on later")
    if step.needs_loop:
        scene.start()
    if step.needs_zero and scene.info is not None and not scene.info.is_zeroed:
        raise preflight_error("not-zeroed")
    if step.needs_torque and scene.simulation is None:
        require(lacks(files.record, scene.inputs(), _now(scene.rig)))
    scene.serials = _commissioned_with(files)
    by_hand_before = files.record.of(StepId.BY_HAND)
    if by_hand_before is not None and by_hand_before.raw:
        stops = read_raw(files.folder, by_hand_before.raw[0])
        scene.stops = manual_joints.stop_errors(stops)
    started = _now(scene.rig)
    values = step.collect(scene)
    judgement = step.judge(values)
    ended = _now(scene.rig)
    name = f"commissioning_{step.id}_{ended:%Y%m%dT%H%M%S}.npz"
    raw = write_raw(files.folder, name, values)
    present = scene.inputs()
    present |= files.record.reported_inputs()
    files.keep(
        StepRecord(
            step=step.id,
            subject=scene.rig.row.name if step.id is StepId.CONTAINER else "",
            started=started,
            ended=ended,
            operator=operator,
            inputs=inputs_of(step.id, present),
            raw=(raw,),
            quantities=judgement.quantities,
            verdict="wrong" if judgement.cause else "sound",
            cause=judgement.cause,
        )
    )
    say_judgement(scene.console, step, judgement)
    return judgement


def _commissioned_with(files: RecordFolder) -> list[int | None]:
    """Return the serial numbers of the arm when C2 was last sound; [] = never."""
    identity = files.record.of(StepId.IDENTITY)
    if identity is None or not identity.raw:
        return []
    values = read_raw(files.folder, identity.raw[0])
    is_wrong = identity.verdict == "wrong"
    return bus.commissioned_with(values) if is_wrong else bus.serials_of(values)


def wanted(
    scene: Scene, steps: Sequence[Step], files: RecordFolder, *, is_anew: bool
) -> list[Step]:
    """Return the steps that have to be done; all if `is_anew`."""
    if is_anew:
        return list(steps)
    now, terrain = _now(scene.rig), scene.rig.row.name
    missing = lacks(files.record, scene.inputs(), now, terrain)
    lacking = {lack.step for lack in missing}
    return [step for step in steps if step.id in lacking]


def say_judgement(console: Console, step: Step, judgement: Judgement) -> None:
    """Print the judgement of a step in one line, with the remedy of a failure."""
    console.end_panel()
    name = f"{step.id} {step.id.words}"
    for note in judgement.notes:
        console.check(WARNING, name, note)
    if judgement.cause:
        console.check(BAD, name, judgement.cause)
        console.say(f"   {step.remedy}")
        return
    shown = sorted(judgement.quantities, key=_nearness, reverse=True)[:SHOWN]
    text = ", ".join(row.text for row in judgement.quantities if row in shown)
    console.check(GOOD, name, text)


def _nearness(measured: Measured) -> float:
    """Ratio of a quantity to its upper limit, 0..1; 0 without one."""
    if measured.high is None or measured.high == 0.0:
        return 0.0
    return abs(measured.value / measured.high)


def recheck(files: RecordFolder, console: Console) -> bool:
    """Judge every recording again and write changes; returns whether all pass.

    Raises:
        SettingsError: a recording is missing or was changed.
    """
    is_sound = True
    for done in files.record.steps:
        (raw,) = done.raw
        step = STEPS[done.step]
        judgement = step.judge(read_raw(files.folder, raw))
        say_judgement(console, step, judgement)
        is_sound = is_sound and not judgement.cause
        verdict = "wrong" if judgement.cause else "sound"
        if (judgement.quantities, verdict) != (done.quantities, done.verdict):
            console.say(f"   it was {done.verdict}; the record says so now")
            changed = {
                "quantities": judgement.quantities,
                "verdict": verdict,
                "cause": judgement.cause,
            }
            files.keep(done.model_copy(update=changed))
    return is_sound


def _now(rig: Rig) -> datetime:
    return datetime.fromtimestamp(rig.clock.utc_ns() // 1_000_000_000, UTC)
