"""A fault that goes on while nothing is wanted of the arm is told once."""

from dataclasses import replace

import pytest

from acquisition.control_loop.states import ArmState
from experiments.operator.prompts import Prompt
from experiments.rig import fake as simulated
from experiments.session.reducer import replay
from tests.experiments.program import journal, run_watched

pytestmark = [pytest.mark.slow, pytest.mark.timeout(120)]
MANY = 40  # looks of 20 ms, of which the fault takes 5 and more each time it is mended


def narrow(backend):
    """Let joint 6 stand beyond what it is allowed from now on."""
    cycle = backend.loop_client.advance_cycles._loop._cycle._cycle
    upper = (*cycle.limits.q_upper[:5], -1.5, cycle.limits.q_upper[6])
    cycle.limits = replace(cycle.limits, q_upper=upper)


@pytest.fixture
def crews(monkeypatch):
    """Return the crews that work a rig from now on."""
    seen = []

    class Seen(simulated.InProcessBackend):
        def __init__(self, *arguments, **named):
            super().__init__(*arguments, **named)
            seen.append(self)

    monkeypatch.setattr(simulated, "InProcessBackend", Seen)
    return seen


@pytest.mark.parametrize("prompt", [Prompt.REVIEW, Prompt.PAUSED])
def test_keys_are_heard_while_a_fault_goes_on(config, tmp_path, crews, prompt):
    looks, states = [], set()

    def press(asked, _):
        if asked.prompt is prompt:
            looks.append(asked)
            states.add(crews[0].loop_client.status.state)
            if len(looks) == 1:
                narrow(crews[0])
            return "q" if len(looks) > MANY else ""
        if asked.prompt is Prompt.READY:
            return "p" if prompt is Prompt.PAUSED else " "
        if asked.prompt is Prompt.RECORDING:
            return " " if asked.since > 0.5 else ""
        return None

    seen = run_watched(config, tmp_path, 1, press=press)
    assert len(looks) == MANY + 1
    assert states <= {ArmState.HOLD, ArmState.DAMP}
    assert seen.done.err.count("Joint 6 at ") == 1
    assert (seen.done.code, replay(journal(seen.folder)).phase) == (5, "unfinished")
