"""A served arm whose commissioning is taken for granted, so that torque may be sent."""

from datetime import UTC, datetime
from pathlib import Path

from experiments.commissioning.inputs import inputs_of, present_inputs
from experiments.commissioning.record import (
    NAME,
    Commissioning,
    StepRecord,
    write_commissioning,
)
from experiments.commissioning.steps import GATED
from experiments.preflight.connecting import connect_rig
from experiments.settings.load import load_settings


def take_as_commissioned(config: Path) -> None:
    """Write a record of sound steps beside `config` for the arm that it names.

    The arm is asked what it is, as a command would; nothing is done where there is a
    record already.

    Raises:
        TractionError: there is no such arm.
    """
    if (config.parent / NAME).exists():
        return
    settings = load_settings(config)
    rig = connect_rig(settings, settings.matrix.terrains[0], None)
    try:
        info = rig.backend.start_arm()
        present = present_inputs(rig, rig.backend.arm.answers(), info)
        now = datetime.fromtimestamp(rig.clock.utc_ns() // 1_000_000_000, UTC)
    finally:
        rig.backend.close()
    record = Commissioning(program="a test")
    for step in GATED:
        done = StepRecord(
            step=step,
            started=now,
            ended=now,
            operator="a test",
            witness="",
            inputs=inputs_of(step, present),
            verdict="sound",
        )
        record = record.with_step(done)
    write_commissioning(config.parent, record)
