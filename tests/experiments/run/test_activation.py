"""From idle to active: torques first, then the pendant and [space]."""

import pytest

from acquisition.control_loop.faults import Action, Fault, GuardVerdict
from acquisition.control_loop.states import ArmState
from acquisition.devices import BusCondition, SafetyMode
from acquisition.errors import PreflightError
from acquisition.sample import MOTOR_FRESH_SHIFT, Sample
from experiments.operator.prompts import Prompt
from experiments.run.ready import PATIENCE, activate
from experiments.run.stop import ArmFaultError
from tests.experiments.run.bench import Keys, make_loop

ALL = 0x7F


class Pendant(Keys):
    """Operator who activates the arm at one look and presses keys at others."""

    def __init__(self, loop_status, keys, active_at):
        super().__init__()
        self.loop_status, self.pressed, self.active_at = loop_status, keys, active_at

    def answer(self, state):
        looks = len(self.states)
        if looks == self.active_at:
            self.loop_status.safety = SafetyMode.ACTIVE
        self.states.append(state)
        return self.pressed.get(looks, "")


def bench(*, keys=(), active_at=None, fresh=ALL, state=ArmState.HOLD):
    """Console loop whose arm has fresh replies of the motors in the mask `fresh`."""
    loop = make_loop(Keys())
    client = loop.loop_client
    loop.operator = Pendant(client.status, dict(keys), active_at)
    client.status.safety = SafetyMode.IDLE
    client.loop.control = client.status
    sample = Sample()
    sample.flags[0] = fresh << MOTOR_FRESH_SHIFT

    def obey():
        if client.requested:
            client.status.state = state

    client.latest = lambda: sample.data
    client.on_advance.append(obey)
    return loop


def looks(loop):
    return len(loop.operator.states)


def test_hold_is_requested_before_the_pendant():
    loop = bench(keys={0: " "}, active_at=0)
    activate(loop)
    assert loop.loop_client.requested == [ArmState.HOLD]
    assert {state.prompt for state in loop.operator.states} == {Prompt.SUPPORT}


def test_the_loop_gets_time_for_the_first_torques():
    loop = bench(keys={0: " "}, active_at=0)
    at_first_words = []
    loop.console.say = lambda _: at_first_words.append(loop.loop_client.advanced)
    activate(loop)
    assert at_first_words == [pytest.approx(0.1)]


@pytest.mark.parametrize(("space", "active", "needed"), [(4, 2, 5), (2, 4, 5)])
def test_activation_needs_both_space_and_the_pendant(space, active, needed):
    loop = bench(keys={space: " "}, active_at=active)
    activate(loop)
    assert looks(loop) == needed


def test_another_key_does_not_replace_space():
    loop = bench(keys={0: "x", 7: " "}, active_at=0)
    activate(loop)
    assert looks(loop) == 8


def test_activation_times_out_without_the_pendant():
    loop = bench(keys={0: " "})
    with pytest.raises(PreflightError) as refused:
        activate(loop)
    assert f"{PATIENCE:.0f} s" in refused.value.message
    assert loop.loop_client.advanced == pytest.approx(PATIENCE + 0.1, abs=0.05)


def test_activation_times_out_without_space():
    with pytest.raises(PreflightError):
        activate(bench(active_at=0))


@pytest.mark.parametrize(
    ("silent", "named"),
    [(0b0000100, "Puck 3 has"), (0b1000001, "Pucks 1,7 have")],
)
def test_silent_pucks_are_reported_before_the_pendant_is_asked_for(silent, named):
    loop = bench(fresh=ALL & ~silent, state=ArmState.IDLE)
    with pytest.raises(PreflightError) as refused:
        activate(loop)
    assert named in refused.value.message
    assert "100 ms" in refused.value.message
    assert looks(loop) == 0


def test_a_bus_that_is_down_is_reported_instead_of_the_pucks():
    loop = bench(fresh=0, state=ArmState.IDLE)
    loop.loop_client.loop.bus_condition = BusCondition.DOWN
    with pytest.raises(PreflightError) as refused:
        activate(loop)
    assert "CAN interface" in refused.value.message


def test_an_e_stop_is_reported_instead_of_the_pucks():
    loop = bench(fresh=0, state=ArmState.IDLE)
    loop.loop_client.status.safety = SafetyMode.E_STOP
    with pytest.raises(PreflightError) as refused:
        activate(loop)
    assert "E-stop" in refused.value.message


def test_a_guard_verdict_during_activation_is_reported():
    loop = bench(state=ArmState.IDLE)
    verdict = GuardVerdict(Action.IDLE, Fault.E_STOP)
    loop.loop_client.status.verdict = verdict
    with pytest.raises(ArmFaultError) as fault:
        activate(loop)
    assert fault.value.verdict is verdict


def test_a_latched_fault_is_reported_before_hold_is_requested():
    loop = bench(keys={0: " "}, active_at=0)
    loop.loop_client.status.latch(GuardVerdict(Action.IDLE, Fault.E_STOP))
    with pytest.raises(ArmFaultError):
        activate(loop)
    assert loop.loop_client.requested == []
