"""Pucks that do not obey their commands are reported, obedient ones are not."""

import numpy as np
import pytest

from acquisition.devices import MotorChange, SafetyMode
from fakes.pucks.options import NetworkOptions
from tests.fakes.stepped import Rig
from wam.bus.frames import MOTOR_NODES, Group, Property, group_id
from wam.bus.properties import PuckMode
from wam.driver.arm import WamArm
from wam.driver.command_watch import CommandWatch

HOME_COUNTS = (0, -36833, 36832, -36728, 0, 0, 0)
CYCLE_NS = 2_000_000
JOINTS = np.array([1.0, 1.5, 0.8, 0.6, 0.5, 0.2, 0.3])  # N m, some for every motor
PERIODS = 100  # 0.2 s, within which a contradiction has to be reported
GROUPS = {Group.LOWER_TORQUE: (1, 2, 3, 4), Group.WRIST_TORQUE: (5, 6, 7)}


class Driven:
    """An arm that is driven with torques that change in every cycle."""

    def __init__(self, *, is_active=True):
        self.rig = Rig(NetworkOptions(), HOME_COUNTS)
        self.arm = WamArm(self.rig.link, self.rig.clock)
        self.arm.start()
        self.number = 0
        self.deviation = None
        self.run(20)
        if is_active:
            self.rig.network.pendant("activate")
            self.run(50)
        assert self.deviation is None

    def run(self, cycles):
        """Run until a contradiction is reported; return the number of cycles."""
        for cycle in range(cycles):
            self.number += 1
            reading = self.arm.read(self.rig.clock.t_ns)
            if reading.is_complete:
                share = 0.1 + 0.05 * np.sin(0.1 * self.number)
                self.arm.send(share * JOINTS, np.zeros(7))
            self.rig.rest(CYCLE_NS - self.rig.clock.t_ns % CYCLE_NS)
            if reading.disobeys is not None:
                self.deviation = reading.disobeys
                return cycle
        return cycles


@pytest.fixture
def driven():
    return Driven()


def test_obedient_pucks_are_not_reported(driven):
    network = driven.rig.network
    for press in ("idle", "activate", "estop"):
        assert driven.run(700) == 700
        network.pendant(press)
    assert driven.run(200) == 200


def test_an_arm_awaiting_activation_is_not_reported():
    waiting = Driven(is_active=False)
    assert waiting.run(500) == 500


def test_single_lost_torque_frames_are_not_reported(driven):
    rng = np.random.default_rng(1)
    groups = [group_id(group) for group in GROUPS]
    driven.rig.network.faults.lose_from_host(
        lambda can_id, _: can_id in groups and rng.random() < 0.02
    )
    assert driven.run(3000) == 3000


def test_lost_replies_are_not_reported_as_disobedience(driven):
    for node in MOTOR_NODES:
        driven.rig.network.faults.lose_from_host(
            lambda can_id, data, node=node: can_id == node and len(data) == 1
        )
    assert driven.run(1000) == 1000


@pytest.mark.parametrize("node", MOTOR_NODES)
def test_a_puck_that_leaves_torque_mode_is_reported(driven, node):
    driven.rig.network.lose_mode(node)
    assert driven.run(PERIODS) < PERIODS
    assert driven.deviation == MotorChange(node, "MODE", PuckMode.TORQUE, PuckMode.IDLE)


@pytest.mark.parametrize("group", GROUPS)
def test_torques_that_reach_no_puck_are_reported(driven, group):
    lost = group_id(group)
    driven.rig.network.faults.lose_from_host(lambda can_id, _: can_id == lost)
    assert driven.run(PERIODS) < PERIODS
    assert driven.deviation.name == "T"
    assert driven.deviation.motor in GROUPS[group]
    assert driven.deviation.value != driven.deviation.was


@pytest.mark.parametrize("node", MOTOR_NODES)
def test_a_puck_that_missed_idle_is_idled_individually_and_reported(driven, node):
    network = driven.rig.network
    network.deafen(node)
    assert driven.arm.idle()
    assert network.driven() == []
    driven.run(1)
    assert driven.deviation == MotorChange(node, "MODE", PuckMode.IDLE, PuckMode.TORQUE)


@pytest.mark.parametrize("node", MOTOR_NODES)
def test_a_puck_that_cannot_be_idled_keeps_its_torque_and_loses_its_power(driven, node):
    network, motors = driven.rig.network, driven.rig.motors
    network.deafen(node)
    network.faults.lose_from_host(
        lambda can_id, data: can_id == node and len(data) > 1  # a set, not a request
    )
    pulls = motors.units[node - 1]
    assert not driven.arm.idle()
    assert motors.units[node - 1] == pulls != 0
    for _ in range(200):
        driven.arm.listen(driven.rig.clock.t_ns)
        driven.rig.rest(CYCLE_NS)
    assert network.safety_mode is SafetyMode.E_STOP
    assert network.driven() == []
    assert driven.arm.safety_mode() is SafetyMode.E_STOP


def test_a_suspicion_is_confirmed_only_by_a_later_report_of_the_module():
    watch = CommandWatch()
    watch.begin([None] * 7, [200] * 7)
    watch.note_sent([0] * 7)
    node, number = watch.question()
    wrong = Property(number, 99)
    assert watch.judge(node, wrong, 5, 5) is None
    for active_ns in (4, 5):
        assert watch.is_to_be_confirmed(active_ns)
        assert watch.judge(node, wrong, 6, active_ns) is None
    assert not watch.is_to_be_confirmed(6)
    assert watch.judge(node, wrong, 7, 6) is not None
