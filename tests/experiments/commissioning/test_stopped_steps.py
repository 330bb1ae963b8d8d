"""A stop pressed during a step ends the commissioning run without a verdict."""

import pytest

from acquisition.devices import SafetyMode
from acquisition.errors import PreflightError
from experiments.commissioning.evidence.order import StepId
from experiments.commissioning.guide import RecordFolder, do_step
from experiments.commissioning.procedure import STEPS
from experiments.commissioning.scene import Scene
from experiments.operator.auto_operator import AutoOperator
from experiments.operator.console import Console
from experiments.preflight.connecting import connect_rig
from experiments.rig.rig import FakeOptions
from experiments.run.console_loop import ConsoleLoop
from experiments.run.stop import ArmFaultError, StopFlag
from experiments.settings.load import load_settings


@pytest.fixture
def scene():
    settings = load_settings(None)
    row = settings.matrix.terrains[0]
    rig = connect_rig(settings, row, FakeOptions("fast", 1))
    console_loop = ConsoleLoop(rig, Console(color=False), AutoOperator(), StopFlag())
    yield Scene(rig, console_loop)
    rig.backend.close()


def press_in(scene: Scene, mode: SafetyMode, button: str, seconds: float) -> None:
    """Press `button` once, `seconds` after the module was first in `mode`."""
    ticks = round(seconds / 0.02)

    def look() -> None:
        nonlocal ticks
        if ticks and scene.loop_client.status.safety is mode:
            ticks -= 1
            if not ticks:
                assert scene.simulation is not None
                scene.simulation.pendant(button)

    scene.loop_client.on_tick.append(look)


@pytest.mark.slow
@pytest.mark.parametrize("button", ["estop", "idle"])
def test_a_stop_of_a_held_arm_gives_the_step_no_verdict(scene, tmp_path, button):
    files = RecordFolder.open(tmp_path, is_simulated=True)
    press_in(scene, SafetyMode.ACTIVE, button, 1.0)
    with pytest.raises(ArmFaultError):
        do_step(scene, STEPS[StepId.LOCK_AND_CLOCK], files, "Ada")
    assert not files.record.steps


def test_a_stop_while_the_arm_is_idle_is_reported_at_once(scene, tmp_path):
    files = RecordFolder.open(tmp_path, is_simulated=True)
    start_ns = scene.rig.clock.now_ns()
    press_in(scene, SafetyMode.IDLE, "estop", 2.0)
    with pytest.raises(PreflightError, match="no power"):
        do_step(scene, STEPS[StepId.LOCK_AND_CLOCK], files, "Ada")
    assert not files.record.steps
    assert scene.rig.clock.now_ns() - start_ns < 4e9
