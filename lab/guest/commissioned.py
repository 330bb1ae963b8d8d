"""Records of a passed commissioning for a served arm, so that torque may be sent."""

from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path

from experiments.commissioning.evidence.inputs import current_inputs, inputs_of
from experiments.commissioning.evidence.order import GATED, StepId
from experiments.commissioning.evidence.record import (
    NAME,
    Commissioning,
    StepRecord,
    write_commissioning,
)
from experiments.preflight.connecting import connect_rig
from experiments.rig.requests import LastAnswers, StartArm
from experiments.rig.rig import Rig
from experiments.settings.load import load_settings
from wam.driver.startup import ArmInfo


def write_passed_commissioning(config: Path, steps: Sequence[StepId] = GATED) -> None:
    """Write a record of passed `steps` next to `config` for the configured arm.

    The arm is queried for its identity, as by a command; an existing record is kept.

    Raises:
        TractionError: there is no such arm.
    """
    if (config.parent / NAME).exists():
        return
    settings = load_settings(config)
    rig = connect_rig(settings, settings.matrix.terrains[0], None)
    try:
        record = sound_record(rig, rig.backend.ask(StartArm()), steps)
    finally:
        rig.backend.close()
    write_commissioning(config.parent, record)


def sound_record(
    rig: Rig, info: ArmInfo, steps: Sequence[StepId] = GATED
) -> Commissioning:
    """Return a record of `steps` for a started arm; all steps allow driving it."""
    present = current_inputs(rig, rig.backend.ask(LastAnswers()), info)
    now = datetime.fromtimestamp(rig.clock.utc_ns() // 1_000_000_000, UTC)
    return record_of(steps, present, now)


def record_of(
    steps: Iterable[StepId], present: Mapping[str, str], when: datetime
) -> Commissioning:
    """Return a record in which `steps` passed with the inputs `present`."""
    record = Commissioning(program="a test")
    for step in steps:
        done = StepRecord(
            step=step,
            started=when,
            ended=when,
            operator="one",
            inputs=inputs_of(step, present),
            verdict="sound",
        )
        record = record.with_step(done)
    return record
