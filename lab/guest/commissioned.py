"""A served arm whose commissioning is taken for granted, so that torque may be sent."""

from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path

from experiments.commissioning.inputs import inputs_of, present_inputs
from experiments.commissioning.record import (
    Commissioning,
    StepRecord,
    read_commissioning,
    write_commissioning,
)
from experiments.commissioning.steps import GATED, ProofStep
from experiments.preflight.connecting import connect_rig
from experiments.rig.rig import Rig
from experiments.settings.load import load_settings
from wam.driver.startup import ArmInfo


def take_as_commissioned(config: Path, steps: Sequence[ProofStep] = GATED) -> None:
    """Write `steps` as sound into the record beside `config`, for the arm it names.

    The arm is asked what it is, as a command would; what the record has already stays.

    Raises:
        TractionError: there is no such arm, or the record was changed.
    """
    record = read_commissioning(config.parent)
    missing = [step for step in steps if record is None or record.of(step) is None]
    if not missing:
        return
    settings = load_settings(config)
    rig = connect_rig(settings, settings.matrix.terrains[0], None)
    try:
        taken = sound_record(rig, rig.backend.start_arm(), missing)
    finally:
        rig.backend.close()
    for done in taken.steps if record is not None else ():
        record = record.with_step(done)
    write_commissioning(config.parent, record or taken)


def sound_record(
    rig: Rig, info: ArmInfo, steps: Sequence[ProofStep] = GATED
) -> Commissioning:
    """Return a record of sound `steps` of an arm that was started."""
    present = present_inputs(rig, rig.backend.arm.answers(), info)
    now = datetime.fromtimestamp(rig.clock.utc_ns() // 1_000_000_000, UTC)
    return record_of(steps, present, now)


def record_of(
    steps: Iterable[ProofStep], present: Mapping[str, str], when: datetime
) -> Commissioning:
    """Return a record in which these steps were sound on what was `present`."""
    record = Commissioning(program="a test")
    for step in steps:
        done = StepRecord(
            step=step,
            started=when,
            ended=when,
            operator="one",
            witness="two",
            inputs=inputs_of(step, present),
            verdict="sound",
        )
        record = record.with_step(done)
    return record
