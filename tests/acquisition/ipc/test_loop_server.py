import json

import pytest

from acquisition.clock import PERIOD_NS
from acquisition.control_loop.faults import Action
from acquisition.control_loop.loop import Tick
from acquisition.control_loop.powered_tests import PoweredTestGoal, PoweredTestKind
from acquisition.control_loop.states import ArmState, ControlStatus
from acquisition.devices import BusCondition
from acquisition.ipc.commands import (
    AwaitActivation,
    CommandQueue,
    EnterState,
    LeaveLoop,
    MoveJoints,
    SetBias,
    StartPoweredTest,
    StatusSlot,
    WatchTrial,
)
from acquisition.ipc.layout import ProcessRole, SharedLayout
from acquisition.ipc.loop_server import LoopHooks, LoopServer

MS = 1_000_000
START_NS = 10**12
GOAL = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7)


class Cycle:
    """Keeps every request."""

    def __init__(self):
        self.status = ControlStatus()
        self.replies_ns = 0
        self.is_recording = False
        self.requests, self.reports, self.goals, self.biases = [], [], [], []
        self.ticks = 0

    def request(self, state, known=None):
        self.requests.append((state, known))

    def start(self, known):
        self.requests.append(("start", known))

    def report(self, verdict):
        self.reports.append(verdict)

    def move_to(self, goal, speed):
        self.goals.append((goal, speed))

    def start_powered_test(self, goal):
        self.goals.append(goal)

    def set_bias(self, bias):
        self.biases.append(bias)

    def __call__(self, tick):
        self.ticks += 1
        self.replies_ns = tick.now_ns + 700_000


class Arm:
    sent_ns = 5
    bus_condition = BusCondition.SOUND


class Loop:
    """A loop server whose periods run on demand; the console beats unless silent."""

    def __init__(self):
        self.shared = SharedLayout.create()
        self.cycle = Cycle()
        self.now_ns = START_NS
        self.signals = 0
        self.console = CommandQueue(self.shared.commands)
        around = LoopHooks(lambda: self.now_ns, lambda: {"puck": "warm"}, self.sound)
        self.loop_server = LoopServer(self.cycle, Arm(), self.shared, around)
        self.number = 0

    def sound(self):
        self.signals += 1

    def run(self, seconds, *, beating=(ProcessRole.CONSOLE, ProcessRole.RECORDER)):
        for _ in range(max(1, round(seconds * 500))):
            for role in beating:
                self.shared.heartbeats.beat(role, self.now_ns)
            self.loop_server(Tick(self.number, self.now_ns, self.now_ns, False))
            self.number += 1
            self.now_ns += PERIOD_NS

    def reasons(self):
        return {verdict.reason for verdict in self.cycle.reports}


@pytest.fixture
def loop():
    return Loop()


def test_commands_reach_the_cycle_and_are_confirmed(loop):
    loop.console.post(AwaitActivation(3))
    loop.console.post(EnterState(ArmState.FLOAT, 4))
    loop.console.post(WatchTrial(True))
    loop.console.post(SetBias((1.0, 2.0, 3.0, 4.0, 5.0, 6.0)))
    number = loop.console.post(MoveJoints(GOAL, 0.25))
    loop.run(0.002)
    assert loop.cycle.requests == [("start", 3), (ArmState.FLOAT, 4)]
    assert loop.cycle.is_recording
    assert loop.cycle.biases == [(1.0, 2.0, 3.0, 4.0, 5.0, 6.0)]
    assert loop.cycle.goals == [(GOAL, 0.25)]
    assert StatusSlot(loop.shared.status).read().obeyed == number


def test_powered_tests_reach_the_cycle(loop):
    ramp = PoweredTestGoal(PoweredTestKind.RAMP, 3, 0.5, 2.0)
    loop.console.post(StartPoweredTest(ramp))
    loop.run(0.002)
    assert loop.cycle.goals == [ramp]


def test_the_loop_ends_on_command(loop):
    loop.run(0.01)
    assert not loop.loop_server.is_over
    loop.console.post(LeaveLoop())
    loop.run(0.002)
    assert loop.loop_server.is_over


def test_the_end_of_the_loop_is_visible(loop):
    loop.run(0.01)
    assert StatusSlot(loop.shared.status).read().is_running
    loop.loop_server.leave()
    assert not StatusSlot(loop.shared.status).read().is_running


def test_heartbeats_of_console_and_recorder_cause_no_verdict(loop):
    loop.cycle.is_recording = True
    loop.run(3.0)
    assert loop.cycle.reports == []


def test_a_silent_console_makes_the_arm_hold_after_its_timeout(loop):
    loop.run(0.1)
    loop.run(0.5, beating=())
    assert loop.cycle.reports == []
    loop.run(0.004, beating=())
    assert loop.reasons() == {"console-silent"}
    assert {verdict.action for verdict in loop.cycle.reports} == {Action.HOLD}


def test_a_returning_console_is_accepted(loop):
    loop.run(0.1)
    loop.run(0.6, beating=())
    loop.cycle.reports.clear()
    loop.run(0.1)
    assert loop.cycle.reports == []


def test_an_unattended_arm_rings_the_bell_repeatedly(loop):
    loop.run(0.1)
    loop.run(59.9, beating=())
    assert loop.signals == 0
    loop.run(3.2, beating=())
    assert loop.signals == 3
    assert not loop.loop_server.is_over


def test_a_silent_recorder_stops_a_trial_only(loop):
    loop.run(0.1)
    loop.run(1.0, beating=(ProcessRole.CONSOLE,))
    assert loop.cycle.reports == []
    loop.cycle.is_recording = True
    loop.run(0.002, beating=(ProcessRole.CONSOLE,))
    assert loop.reasons() == {"recorder-silent"}


def test_an_orphaned_arm_holds_at_once_and_idles_later(loop):
    loop.run(0.1)
    loop.loop_server.on_console_death()
    loop.run(0.002)
    assert loop.reasons() == {"console-lost"}
    loop.run(0.998)
    assert loop.cycle.requests == []
    loop.run(0.01)
    assert set(loop.cycle.requests) == {(ArmState.IDLE, None)}
    assert loop.loop_server.is_over


def test_the_loop_publishes_its_heartbeat_and_event_times(loop):
    loop.run(0.004)
    assert loop.shared.heartbeats.last_ns(ProcessRole.CONTROL) == START_NS + PERIOD_NS
    (first, second) = loop.shared.timings.last(2)
    assert int(second["number"]) == int(first["number"]) + 1
    assert int(second["replies_ns"]) == START_NS + PERIOD_NS + 700_000
    assert int(second["sent_ns"]) == Arm.sent_ns


def test_device_status_is_published_periodically(loop):
    loop.run(0.002)
    version = loop.shared.health.version
    assert json.loads(loop.shared.health.read()) == {"puck": "warm"}
    loop.run(0.99)
    assert loop.shared.health.version == version
    loop.run(0.02)
    assert loop.shared.health.version != version


def test_the_bell_first_rings_after_the_unattended_time(loop):
    loop.run(0.1)
    loop.run(60.0, beating=())
    before = loop.signals
    loop.run(1.0, beating=())
    assert (before, loop.signals) == (0, 1)


def test_device_status_is_published_at_the_start_of_a_trial(loop):
    loop.run(0.1)
    version = loop.shared.health.version
    loop.console.post(WatchTrial(True))
    loop.run(0.002)
    assert loop.shared.health.version != version
