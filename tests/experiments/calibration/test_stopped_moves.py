"""The arm stops if the console freezes during a move of a calibration."""

import numpy as np
import pytest

from acquisition.devices import SafetyMode
from acquisition.ipc.loop_client import LoopClient
from acquisition.ipc.loop_server import SILENT_NS
from experiments.operator.auto_operator import AutoOperator
from experiments.operator.prompts import Prompt
from tests.experiments.built import watch_builds
from tests.experiments.program import traction

pytestmark = pytest.mark.slow

TOP_SPEED = 0.5  # rad/s
STOPPING = 0.08  # rad, from that speed to a stop
FROZEN_FOR = 3.7  # s


class FrozenConsole:
    """Stops its heartbeat in the middle of a move, and records the arm meanwhile."""

    def __init__(self, patch):
        self.built = watch_builds(patch)
        self.q = []
        self.speed = 0.0
        self.is_frozen = False
        usual_beat, usual_answer = LoopClient.beat, AutoOperator.answer

        def beat(client):
            if not self.is_frozen:
                usual_beat(client)

        def answer(operator, asked):
            if asked.prompt is Prompt.MOVING and asked.since > 3.0:
                self.freeze()
            return usual_answer(operator, asked)

        patch.setattr(LoopClient, "beat", beat)
        patch.setattr(AutoOperator, "answer", answer)

    def freeze(self):
        """Let time pass without the heartbeat of the console."""
        if self.is_frozen:
            return
        self.is_frozen = True
        plant = self.built.rigs[-1].plant
        self.speed = float(np.abs(plant.qd).max())
        client = self.built.backends[-1].loop_client
        for _ in range(round(FROZEN_FOR / 0.02)):
            client.advance_cycles(10)
            self.q.append(plant.q.copy())
        self.is_frozen = False


@pytest.fixture(scope="module")
def frozen(tmp_path_factory):
    """(console, result of the calibration)."""
    out = tmp_path_factory.mktemp("frozen") / "gravity.toml"
    with pytest.MonkeyPatch.context() as patch:
        console = FrozenConsole(patch)
        done = traction("calibrate", "gravity", "--fake", "--fast", "--to", out)
    return console, done


def test_the_arm_stops_as_soon_as_the_console_counts_as_silent(frozen):
    console, _ = frozen
    assert console.speed > 0.1  # it was moving
    q = np.array(console.q)
    silent = round(SILENT_NS * 1e-9 / 0.02)
    travel = np.abs(q - q[0]).max()
    assert travel < TOP_SPEED * SILENT_NS * 1e-9 + STOPPING
    assert np.abs(q[silent:] - q[silent]).max() < STOPPING
    assert np.ptp(q[-50:], axis=0).max() < 2e-3


def test_the_command_reports_the_stopped_move_and_its_cause(frozen):
    console, done = frozen
    assert done.code == 4
    assert "0.5 s" in done.err
    assert "move was stopped" in done.err
    assert done.out.rstrip().endswith("ARM: idle; it sinks slowly, support it.")
    assert console.built.rigs[-1].network.safety_mode is SafetyMode.IDLE


def test_the_message_names_the_calibration_to_repeat_and_no_session(frozen):
    _, done = frozen
    assert "run: traction calibrate gravity." in done.err
    assert "resume" not in done.err
