"""The guard damps an arm that a hand moves too fast, and never drops its weight."""

from dataclasses import replace

import numpy as np
import pytest

from acquisition.control_loop.faults import Action
from acquisition.control_loop.states import ArmState
from acquisition.devices import SafetyMode
from experiments.rig.requests import OpenSensor, StartArm
from experiments.rig.rig import FakeOptions, build_rig
from experiments.settings.load import load_settings

J1, J6 = 0, 5
PULL = 8.0  # N m of the hand at joint 1
FASTEST = (3.0, 3.0, 4.0, 5.0, 8.0, 8.0, 8.0)
# Limits so low that the safety module does not act first.
LIMITS = {
    "overspeed": {"speed": (0.4, *FASTEST[1:])},
    "foot-speed": {"foot_speed": 0.06, "speed": FASTEST},
}


class Bench:
    """A simulated arm that floats, pulled at one joint."""

    def __init__(self, **limits):
        shipped = load_settings(None)
        changed = shipped.rig.limits.model_copy(update=limits)
        rig = shipped.rig.model_copy(update={"limits": changed})
        settings = replace(shipped, rig=rig)
        row = settings.row("TF")
        self.rig = build_rig(settings, row, FakeOptions("fast", seed=1))
        backend = self.rig.backend
        self.loop_client = backend.loop_client
        self.plant = self.rig.simulation.rig.plant
        backend.ask(StartArm())
        backend.ask(OpenSensor())
        backend.begin()
        self.loop_client.start()
        self.loop_client.advance(0.1)
        self.rig.simulation.pendant("activate")
        self.loop_client.advance(0.2)
        self.loop_client.request(ArmState.FLOAT)
        self.loop_client.advance(0.1)
        self.plant.hand.let_go()

    def pull(self, joint, torque):
        """Pull at a joint until the guard acts; its verdict."""
        self.plant.disturbance[joint] = torque
        for _ in range(100):
            self.loop_client.advance(0.004)
            if self.loop_client.status.verdict is not None:
                break
        return self.loop_client.status.verdict


@pytest.fixture
def build():
    benches = []

    def build_one(**limits):
        benches.append(Bench(**limits))
        return benches[-1]

    yield build_one
    for bench in benches:
        bench.rig.backend.close()


@pytest.mark.parametrize("reason", LIMITS)
def test_an_arm_that_is_too_fast_is_damped(build, reason):
    bench = build(**LIMITS[reason])
    verdict = bench.pull(J1, PULL)
    assert (verdict.reason, verdict.action) == (reason, Action.DAMP)
    assert bench.loop_client.status.state is ArmState.DAMP


@pytest.mark.parametrize("reason", LIMITS)
def test_a_damped_arm_is_braked_and_its_weight_stays_compensated(build, reason):
    bench = build(**LIMITS[reason])
    bench.pull(J1, PULL)
    bench.plant.disturbance[:] = 0.0
    bench.loop_client.advance(0.2)
    records = bench.loop_client.last(0.2)
    brake = (records["torque_command"] - records["torque_gravity"])[:, J1]
    speed = records["velocity"][:, J1]
    moving = np.abs(speed) > 0.1
    assert moving.sum() > 5
    assert (brake[moving] * speed[moving] < 0.0).all()
    assert np.abs(records["torque_command"][:, 1]).min() > 5.0  # the arm is held up


def test_a_damped_arm_comes_to_rest_and_stays_active(build):
    bench = build(**LIMITS["overspeed"])
    bench.pull(J1, PULL)
    bench.plant.disturbance[:] = 0.0
    bench.loop_client.advance(2.0)
    assert np.abs(bench.plant.qd).max() < 0.05
    assert bench.loop_client.status.state is ArmState.DAMP
    assert bench.loop_client.status.safety is SafetyMode.ACTIVE


@pytest.mark.slow
def test_an_arm_pressed_against_a_stop_is_held_off_by_the_soft_wall(build):
    bench = build()
    upper = bench.rig.model.constants.q_upper[J6]
    for second in range(20):  # slowly, and held there
        bench.plant.disturbance[J6] = min(0.1 * second, 0.8)
        bench.loop_client.advance(0.2)
    depth = bench.plant.q[J6] - (upper - 0.1)
    # The hand and the foot's own weight against a spring of 2.5 N m in 0.2 rad.
    assert 0.04 < depth < 0.09
    assert bench.loop_client.status.verdict is None
