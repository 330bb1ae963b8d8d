"""Leads through the steps: collects, judges, writes the record after each."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from experiments import provenance
from experiments.commissioning.gate import lacks, require
from experiments.commissioning.inputs import inputs_of
from experiments.commissioning.record import (
    Commissioning,
    Measured,
    StepRecord,
    read_commissioning,
    write_commissioning,
)
from experiments.commissioning.steps import ProofStep
from experiments.messages import preflight_error
from experiments.operator.console import BAD, GOOD, WARNING, Console
from experiments.proving import bus, by_hand
from experiments.proving.limits import Judgement
from experiments.proving.recording import read_raw, write_raw
from experiments.proving.scene import Scene
from experiments.proving.work import WORK
from experiments.rig.rig import Rig

SHOWN = 4  # quantities of a step that passed, on the screen


@dataclass(slots=True)
class RecordFolder:
    """commissioning.json of one arm and the recordings beside it.

    Attributes:
        folder: where they are.
        record: as it stands.
    """

    folder: Path
    record: Commissioning

    @classmethod
    def open(cls, folder: Path, *, is_simulated: bool) -> "RecordFolder":
        """Return what is there, or an empty record.

        Raises:
            SettingsError: what is there is no record, or was changed.
        """
        record = read_commissioning(folder)
        if record is None:
            software = provenance.collect()["software"]
            record = Commissioning(program=software, is_simulated=is_simulated)
        return cls(folder, record)

    def keep(self, done: StepRecord) -> None:
        """Write the record with a step in its place."""
        self.record = self.record.with_step(done)
        write_commissioning(self.folder, self.record)

    def tell(self, name: str, when: datetime) -> None:
        """Write that a basis of `steps.BASES` changed, as a person says."""
        self.record = self.record.with_told(name, when)
        write_commissioning(self.folder, self.record)


def do_step(
    scene: Scene, step: ProofStep, files: RecordFolder, operator: str
) -> Judgement:
    """Do one step and write what came of it.

    Args:
        scene: the rig and the terminal.
        step: which.
        files: the record.
        operator: who does it.

    Raises:
        PreflightError: the arm is not fit, or a person did not do what was asked.
        StopRequestedError: as `ConsoleLoop.tick`.
    """
    work = WORK[step]
    scene.say("")
    scene.say(
        f"{step} {step.words}, about {work.minutes:g} min   [q]uit, to go on later"
    )
    if work.needs_loop:
        scene.start()
    if work.needs_zero and scene.info is not None and not scene.info.is_zeroed:
        raise preflight_error("not-zeroed")
    if work.needs_proof and scene.simulation is None:
        require(lacks(files.record, scene.inputs(), _now(scene.rig)))
    scene.serials = _commissioned_with(files)
    by_hand_before = files.record.of(ProofStep.BY_HAND)
    if by_hand_before is not None and by_hand_before.raw:
        stops = read_raw(files.folder, by_hand_before.raw[0])
        scene.stops = by_hand.stop_errors(stops)
    started = _now(scene.rig)
    values = work.collect(scene)
    judgement = work.judge(values)
    ended = _now(scene.rig)
    name = f"commissioning_{step}_{ended:%Y%m%dT%H%M%S}.npz"
    raw = write_raw(files.folder, name, values)
    present = scene.inputs()
    present |= files.record.told_inputs()
    files.keep(
        StepRecord(
            step=step,
            subject=scene.rig.row.name if step is ProofStep.CONTAINER else "",
            started=started,
            ended=ended,
            operator=operator,
            inputs=inputs_of(step, present),
            raw=(raw,),
            quantities=judgement.quantities,
            verdict="wrong" if judgement.cause else "sound",
            cause=judgement.cause,
        )
    )
    say_judgement(scene.console, step, judgement)
    return judgement


def _commissioned_with(files: RecordFolder) -> list[int | None]:
    """Return the serial numbers of the arm when C2 was last sound; [] = it was not."""
    identity = files.record.of(ProofStep.IDENTITY)
    if identity is None or not identity.raw:
        return []
    values = read_raw(files.folder, identity.raw[0])
    is_wrong = identity.verdict == "wrong"
    return bus.commissioned_with(values) if is_wrong else bus.serials_of(values)


def wanted(
    scene: Scene, steps: Sequence[ProofStep], files: RecordFolder, *, is_anew: bool
) -> list[ProofStep]:
    """Return those of `steps` that have to be done; all of them where `is_anew`."""
    if is_anew:
        return list(steps)
    now, terrain = _now(scene.rig), scene.rig.row.name
    found = lacks(files.record, scene.inputs(), now, terrain)
    lacking = {lack.step for lack in found}
    return [step for step in steps if step in lacking]


def say_judgement(console: Console, step: ProofStep, judgement: Judgement) -> None:
    """Say what came of a step in a line, and what to do where it failed."""
    console.end_panel()
    name = f"{step} {step.words}"
    for note in judgement.notes:
        console.check(WARNING, name, note)
    if judgement.cause:
        console.check(BAD, name, judgement.cause)
        console.say(f"   {WORK[step].way_back}")
        return
    most = sorted(judgement.quantities, key=_nearness, reverse=True)[:SHOWN]
    text = ", ".join(each.text for each in judgement.quantities if each in most)
    console.check(GOOD, name, text)


def _nearness(measured: Measured) -> float:
    """Return how near a quantity is to its upper limit, 0..1."""
    if measured.high is None or measured.high == 0.0:
        return 0.0
    return abs(measured.value / measured.high)


def recheck(files: RecordFolder, console: Console) -> bool:
    """Judge every recording again and write what changed; return whether all pass.

    Raises:
        SettingsError: a recording is missing, or is not what was recorded.
    """
    is_sound = True
    for done in files.record.steps:
        (raw,) = done.raw
        judgement = WORK[done.step].judge(read_raw(files.folder, raw))
        say_judgement(console, done.step, judgement)
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
