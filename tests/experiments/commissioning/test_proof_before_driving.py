"""A step that drives a real arm requires the earlier steps of the commissioning."""

from dataclasses import replace

import pytest

from acquisition.errors import PreflightError
from experiments.commissioning.evidence.order import StepId
from experiments.commissioning.evidence.record import write_commissioning
from experiments.commissioning.guide import RecordFolder, do_step
from experiments.commissioning.procedure import STEPS
from experiments.commissioning.scene import Scene
from experiments.operator.auto_operator import AutoOperator
from experiments.operator.console import Console
from experiments.preflight.connecting import connect_rig
from experiments.rig.rig import FakeOptions
from experiments.run.console_loop import ConsoleLoop
from experiments.run.stop import StopFlag
from experiments.settings.load import load_settings
from lab.guest.commissioned import sound_record


@pytest.fixture
def scene():
    """The scene of a rig without simulated hands, like a real one."""
    settings = load_settings(None)
    row = settings.matrix.terrains[0]
    rig = replace(connect_rig(settings, row, FakeOptions("fast", 1)), simulation=None)
    stop = StopFlag()
    yield Scene(rig, ConsoleLoop(rig, Console(color=False), AutoOperator(), stop))
    rig.backend.close()


def test_an_arm_without_the_earlier_steps_is_not_driven(scene, tmp_path):
    files = RecordFolder.open(tmp_path, is_simulated=False)
    with pytest.raises(PreflightError, match="C0 configuration: not done"):
        do_step(scene, STEPS[StepId.CONTAINER], files, ("Ada", "Grace"))
    assert not files.record.steps


def test_a_stale_earlier_step_is_reported(scene, tmp_path):
    scene.start()
    record = sound_record(scene.rig, scene.info)
    lift = record.of(StepId.LIFT)
    assert lift is not None
    stale = lift.model_copy(update={"inputs": {**lift.inputs, "[gravity]": "0" * 64}})
    write_commissioning(tmp_path, record.with_step(stale))
    files = RecordFolder.open(tmp_path, is_simulated=False)
    with pytest.raises(PreflightError, match=r"C10 lift: stale: \[gravity"):
        do_step(scene, STEPS[StepId.CONTAINER], files, ("Ada", "Grace"))
