"""The stop of the pendant ends every guided command, and nothing is written."""

import pytest

from acquisition.devices import SafetyMode
from experiments.operator.auto_operator import AutoOperator
from fakes.world.rig import LocalSimulation
from tests.experiments.built import watch_builds
from tests.experiments.program import traction

pytestmark = pytest.mark.slow

COMMANDS = {
    "teach": ("teach", "bay2"),
    "terrain": ("calibrate", "terrain"),
    "foot": ("calibrate", "foot"),
    "sensor": ("calibrate", "sensor"),
    "gravity": ("calibrate", "gravity"),
    "friction": ("calibrate", "friction"),
}
PRESSED = 3.0  # s after the arm is active


@pytest.mark.parametrize("name", COMMANDS)
def test_the_command_ends_with_an_idle_arm(config, tmp_path, name):
    with pytest.MonkeyPatch.context() as patch:
        built = watch_builds(patch)
        _press_stop(patch, built)
        options = ("--fake", "--fast", "--config", config, "--data", tmp_path)
        out = ("--to", tmp_path / "written.toml")
        done = traction(*COMMANDS[name], *options, *out)
    assert done.code == 4
    assert done.err.startswith("Stop pressed.")
    assert f"traction {' '.join(COMMANDS[name])}" in done.err
    assert built.rig.network.safety_mode is SafetyMode.E_STOP
    assert built.rig.plant.is_idle
    assert list(tmp_path.glob("*.toml")) == []


def _press_stop(patch, built):
    """Press the stop `PRESSED` after the arm is active."""
    usual_answer = AutoOperator.answer
    active = []

    def answer(operator, asked):
        if built.rig.network.safety_mode is SafetyMode.ACTIVE:
            active.append(built.clock.now_ns())
            if active[-1] - active[0] > PRESSED * 1e9:
                LocalSimulation(built.rig).pendant("estop")
        return usual_answer(operator, asked)

    patch.setattr(AutoOperator, "answer", answer)
