from dataclasses import replace

import numpy as np
import pytest

from acquisition.clock import PERIOD_NS
from acquisition.control_loop.cycle import CONTACT_FORCE, Cycle, CycleOutputs
from acquisition.control_loop.details import MotionExcess
from acquisition.control_loop.faults import (
    Action,
    CircuitCauses,
    Fault,
    ReplySilence,
    verdict_for,
)
from acquisition.control_loop.loop import Tick
from acquisition.control_loop.powered_tests import PoweredTestGoal, PoweredTestKind
from acquisition.control_loop.states import ArmState, ControlStatus
from acquisition.devices import ArmReading, SafetyMode, WrenchSample
from acquisition.errors import LinkError
from acquisition.sample import MOTOR_FRESH_SHIFT, SAFETY_MODE_MASK, Flag
from acquisition.schema import CYCLE
from tests.acquisition.control_loop.limits import guard_limits

MS = 1_000_000
START_NS = 1_000 * MS
LIMITS = guard_limits(
    q_lower=(-2.0,) * 7,
    q_upper=(2.0,) * 7,
    speed=(1.5,) * 7,
    torque=np.full(7, 30.0),
)
TORQUE = {
    ArmState.FLOAT: 1.0,
    ArmState.HOLD: 2.0,
    ArmState.DAMP: 3.0,
}


class Arm:
    """A scripted arm that keeps the torques it was sent."""

    def __init__(self):
        self.mode = SafetyMode.ACTIVE
        self.safety_heard_ns = START_NS
        self.is_confirmed = True
        self.q, self.qd = np.zeros(7), np.zeros(7)
        self.missing = 0
        self.clip = 100.0
        self.warnings, self.faults = (), ()
        self.sent = []
        self.idled = 0
        self.asked_ns = 0

    def read(self, now_ns):
        self.asked_ns = now_ns
        return self.reading(now_ns)

    def listen(self, now_ns):
        missing = replace(self.reading(now_ns), fresh=0, is_complete=False)
        return replace(missing, missing_cycles=max(self.missing, 1))

    def reading(self, now_ns):
        return ArmReading(
            host_ns=now_ns,
            arm_ns=now_ns + 700_000,
            counts=list(range(7)),
            q=self.q,
            qd=self.qd,
            qd7_raw=0.0,
            fresh=0x7F if self.missing == 0 else 0x3F,
            is_complete=self.missing == 0,
            missing_cycles=self.missing,
        )

    def send(self, tau, tau_gravity):
        sent = np.clip(tau, -self.clip, self.clip)
        self.sent.append(sent)
        return sent

    def safety_mode(self):
        return self.mode

    def safety_warnings(self):
        return self.warnings

    def safety_faults(self):
        return self.faults

    def idle(self):
        self.idled += 1
        if self.is_confirmed:
            self.mode = SafetyMode.IDLE
        return self.is_confirmed

    def close(self):
        self.idle()


class Sensor:
    def __init__(self):
        self.queue = []

    def open(self):
        """Nothing to configure."""

    def poll(self, now_ns):
        samples, self.queue = self.queue, []
        return samples

    def describe(self):
        return {}

    def close(self):
        """Nothing to give back."""


class Law:
    """Torque 1, 2, 3 N m on every joint in float, hold, damp."""

    def __init__(self):
        self.state = ArmState.IDLE
        self.entered = []
        self.offset = 0.0
        self.stuck = 0
        self.moves = False
        self.energy = 0.0
        self.torques = TORQUE

    def enter(self, state, reading):
        self.state = state
        self.entered.append(state)

    def torque(self, reading):
        tau = np.full(7, self.torques[self.state])
        return tau, tau / 2

    def joint7_offset(self, reading):
        return self.offset

    def kinetic_energy(self, reading):
        return self.energy

    def is_moving(self):
        return self.moves

    def is_testing(self):
        return False

    def stuck_motor(self):
        return self.stuck


class Observer:
    """Reports the force along z of a given wrench."""

    def __init__(self):
        self.speed = 0.0
        self.seen = []

    def observe(self, reading, wrench, sample):
        self.seen.append(wrench)
        if wrench is not None:
            sample.wrench_raw[:] = wrench.wrench
            sample.traction[2] = wrench.wrench[2]
        return self.speed


class Bench:
    """One cycle with everything around it, run period by period."""

    def __init__(self):
        self.arm, self.sensor, self.law = Arm(), Sensor(), Law()
        self.observer = Observer()
        self.records, self.wrenches = [], []
        self.number = 0
        self.now_ns = START_NS
        self.limits = LIMITS
        self.cycle = self.make()

    def make(self, extra_flags=0):
        return Cycle(
            self.arm,
            self.sensor,
            self.law,
            self.observer,
            self.limits,
            CycleOutputs(
                lambda payload: self.records.append(bytes(payload)),
                self.wrenches.extend,
                extra_flags,
            ),
        )

    def run(self, cycles=1, *, force=5.0, is_late=False):
        """Run; every cycle has a fresh force unless `force` is None."""
        for _ in range(cycles):
            if force is not None:
                self.sensor.queue.append(self.wrench(force))
            tick = Tick(self.number, self.now_ns, self.now_ns, is_late)
            self.cycle(tick)
            self.number += 1
            self.now_ns += PERIOD_NS
        return self.record()

    def wrench(self, force, **changes):
        values = (0.0, 0.0, force, 0.0, 0.0, 0.0)
        sample = WrenchSample(self.now_ns, self.number, values, 0, True, 0)
        return replace(sample, **changes)

    def record(self, index=-1):
        return np.frombuffer(self.records[index], CYCLE.dtype)[0]

    def enter(self, state):
        self.cycle.request(state)
        return self.run()

    def start(self):
        """Make the idle arm wait for its activation."""
        self.arm.mode = SafetyMode.IDLE
        self.run()
        self.cycle.start()
        return self.run()

    @property
    def state(self):
        return self.cycle.status.state

    @property
    def reasons(self):
        return [verdict.reason for verdict in self.cycle.status.active_verdicts]

    @property
    def reason(self):
        verdict = self.cycle.status.verdict
        return verdict.reason if verdict else ""


@pytest.fixture
def bench():
    return Bench()


def has(record, flag):
    return bool(record["flags"] & flag)


def test_every_cycle_gives_one_record_with_its_number_and_times(bench):
    bench.run(3)
    assert len(bench.records) == 3
    record = bench.record()
    assert record["cycle"] == 2
    assert record["host_ns"] == START_NS + 2 * PERIOD_NS
    assert record["arm_ns"] == record["host_ns"] + 700_000
    assert record["ft_ns"] == record["host_ns"]
    assert record["ft_counter"] == 2


def test_the_record_contains_the_arm_reading(bench):
    bench.arm.q, bench.arm.qd = np.linspace(0, 1, 7), np.linspace(-1, 0, 7)
    record = bench.run()
    assert record["position"].tolist() == bench.arm.q.tolist()
    assert record["velocity"].tolist() == bench.arm.qd.tolist()
    assert record["counts"].tolist() == list(range(7))


@pytest.mark.parametrize("state", TORQUE)
def test_the_torque_of_a_state_is_sent_in_the_cycle_it_is_entered(bench, state):
    record = bench.enter(state)
    assert bench.arm.sent[-1].tolist() == [TORQUE[state]] * 7
    assert record["torque_command"].tolist() == [TORQUE[state]] * 7
    assert record["torque_gravity"].tolist() == [TORQUE[state] / 2] * 7


def test_an_idle_arm_is_sent_no_torque(bench):
    bench.run()
    assert bench.arm.sent == []


def test_the_record_holds_the_torque_as_sent(bench):
    bench.arm.clip = 0.25
    record = bench.enter(ArmState.FLOAT)
    assert record["torque_command"].tolist() == [0.25] * 7
    assert has(record, Flag.TORQUE_CLIPPED)


def test_unclipped_torque_is_not_flagged(bench):
    assert not has(bench.enter(ArmState.FLOAT), Flag.TORQUE_CLIPPED)


def test_rounding_to_the_motor_unit_is_not_clipping(bench):
    bench.arm.clip = 1.0 - 0.049
    assert not has(bench.enter(ArmState.FLOAT), Flag.TORQUE_CLIPPED)


def test_clipping_on_two_joints_does_not_cancel(bench):
    bench.arm.send = lambda tau, _: tau + np.array([1.0, -1.0, 0, 0, 0, 0, 0])
    assert has(bench.enter(ArmState.FLOAT), Flag.TORQUE_CLIPPED)


def test_a_missing_reply_sends_no_torque(bench):
    bench.enter(ArmState.FLOAT)
    sent = len(bench.arm.sent)
    bench.arm.missing = 1
    bench.law.torques = {ArmState.FLOAT: 9.0}  # wanted, and not sent
    record = bench.run()
    assert len(bench.arm.sent) == sent
    assert record["torque_command"].tolist() == [1.0] * 7  # the motors keep this torque
    assert not has(record, Flag.ARM_FRESH)
    assert not has(record, Flag.TORQUE_CLIPPED)


def test_the_fresh_bits_name_the_silent_motor(bench):
    complete = bench.run()
    bench.arm.missing = 1
    record = bench.run()
    assert int(complete["flags"]) >> MOTOR_FRESH_SHIFT == 0x7F
    assert int(record["flags"]) >> MOTOR_FRESH_SHIFT == 0x3F
    assert has(complete, Flag.ARM_FRESH)


def test_a_state_is_not_entered_on_an_incomplete_reading(bench):
    bench.enter(ArmState.FLOAT)
    bench.arm.missing = 1
    bench.enter(ArmState.HOLD)
    assert bench.state is ArmState.FLOAT
    bench.arm.missing = 0
    bench.run()
    assert bench.state is ArmState.HOLD


def test_idle_does_not_wait_for_a_complete_reading(bench):
    bench.enter(ArmState.FLOAT)
    bench.arm.missing = 1
    bench.enter(ArmState.IDLE)
    assert bench.state is ArmState.IDLE
    assert bench.arm.idled == 1


def test_a_sensor_counter_wider_than_its_field_wraps(bench):
    for counter, recorded in ((2**32 - 1, 2**32 - 1), (2**32 + 5, 5)):
        bench.sensor.queue.append(bench.wrench(5.0, counter=counter))
        assert bench.run(force=None)["ft_counter"] == recorded


def test_a_stale_force_repeats_the_last_value_and_clears_the_bit(bench):
    fresh = bench.run(force=5.0)
    stale = bench.run(4, force=None)
    assert has(fresh, Flag.FT_FRESH)
    assert not has(stale, Flag.FT_FRESH)
    assert stale["wrench_raw"].tolist() == fresh["wrench_raw"].tolist()
    assert stale["ft_ns"] == fresh["ft_ns"]
    assert bench.observer.seen[-1] is None


@pytest.mark.parametrize(("cycles", "is_fresh"), [(3, True), (4, False)])
def test_a_force_is_stale_beyond_its_maximum_age(bench, cycles, is_fresh):
    bench.run(force=5.0)
    assert has(bench.run(cycles, force=None), Flag.FT_FRESH) is is_fresh


def test_there_is_no_force_before_the_first_sample(bench):
    record = bench.run(force=None)
    assert np.isnan(record["wrench_raw"]).all()
    assert record["ft_ns"] == 0
    assert not has(record, Flag.FT_FRESH)


def test_the_newest_of_several_samples_is_used_and_all_are_passed_on(bench):
    bench.sensor.queue = [bench.wrench(1.0), bench.wrench(2.0)]
    record = bench.run(force=None)
    assert record["wrench_raw"][2] == 2.0
    assert [sample.wrench[2] for sample in bench.wrenches] == [1.0, 2.0]


def test_an_invalid_sample_is_not_used(bench):
    good, bad = bench.wrench(1.0), bench.wrench(9.0, is_valid=False)
    bench.sensor.queue = [good, bad]
    record = bench.run(force=None)
    assert record["wrench_raw"][2] == 1.0
    assert bench.wrenches == [good, bad]


def test_the_force_ages_while_only_invalid_samples_arrive(bench):
    bench.run()
    for _ in range(4):
        bench.sensor.queue = [bench.wrench(9.0, is_valid=False)]
        bench.run(force=None)
    record = bench.record()
    assert not has(record, Flag.FT_FRESH)
    assert record["wrench_raw"][2] == 5.0


def test_saturation_is_flagged(bench):
    assert not has(bench.run(), Flag.FT_SATURATED)
    bench.sensor.queue = [bench.wrench(9.0, saturated=1)]
    assert has(bench.run(force=None), Flag.FT_SATURATED)


@pytest.mark.parametrize(
    ("force", "touches"), [(CONTACT_FORCE, False), (1.01 * CONTACT_FORCE, True)]
)
def test_contact_is_flagged(bench, force, touches):
    assert has(bench.run(force=force), Flag.CONTACT) is touches


def test_a_late_cycle_is_flagged(bench):
    assert has(bench.run(is_late=True), Flag.DEADLINE_MISSED)
    assert not has(bench.run(), Flag.DEADLINE_MISSED)


@pytest.mark.parametrize("mode", SafetyMode)
def test_the_safety_mode_is_in_the_flags(bench, mode):
    if mode is SafetyMode.ACTIVE:  # ACTIVE without a request is idled
        bench.enter(ArmState.FLOAT)
    bench.arm.mode = mode
    assert int(bench.run()["flags"]) & SAFETY_MODE_MASK == mode


def test_the_lock_is_flagged_while_it_holds(bench):
    bench.arm.mode = SafetyMode.IDLE
    assert not has(bench.run(), Flag.JOINT7_LOCKED)
    bench.start()
    bench.arm.mode = SafetyMode.ACTIVE
    for state in TORQUE:
        assert has(bench.enter(state), Flag.JOINT7_LOCKED)


def test_a_simulated_arm_is_flagged(bench):
    assert not has(bench.run(), Flag.SIMULATED)
    bench.cycle = bench.make(Flag.SIMULATED)
    assert has(bench.run(), Flag.SIMULATED)


@pytest.mark.parametrize("mode", SafetyMode)
def test_a_sample_has_only_its_own_flags_by_default(bench, mode):
    bench.arm.mode = mode
    usual = bench.run()["flags"]
    outputs = CycleOutputs(
        lambda payload: bench.records.append(bytes(payload)), bench.wrenches.extend
    )
    bench.cycle = Cycle(
        bench.arm, bench.sensor, bench.law, bench.observer, LIMITS, outputs
    )
    assert bench.run()["flags"] == usual


def test_a_verdict_changes_the_torque_in_the_same_cycle(bench):
    bench.enter(ArmState.FLOAT)
    bench.arm.qd = np.full(7, 1.6)
    record = bench.run()
    assert bench.state is ArmState.DAMP
    assert record["torque_command"].tolist() == [3.0] * 7
    assert bench.arm.sent[-1].tolist() == [3.0] * 7
    assert bench.reason == "overspeed"


def test_a_verdict_of_hold_ends_floating(bench):
    bench.enter(ArmState.FLOAT)
    bench.cycle.is_recording = True
    bench.law.offset = 0.06
    record = bench.run()
    assert bench.state is ArmState.HOLD
    assert record["torque_command"].tolist() == [2.0] * 7
    assert bench.reason == "joint7-slip"


def test_a_verdict_ends_the_recording(bench):
    bench.enter(ArmState.FLOAT)
    bench.cycle.is_recording = True
    bench.law.offset = 0.06
    bench.run()
    assert not bench.cycle.is_recording


def test_a_silent_sensor_stops_a_trial_after_its_timeout(bench):
    bench.enter(ArmState.FLOAT)
    bench.cycle.is_recording = True
    bench.run(10, force=None)
    assert bench.state is ArmState.FLOAT
    bench.run(force=None)
    assert (bench.state, bench.reason) == (ArmState.HOLD, "ft-stale")


def test_a_sensor_that_never_sent_a_sample_stops_a_trial(bench):
    bench.cycle.request(ArmState.FLOAT)
    bench.cycle.is_recording = True
    bench.run(12, force=None)
    assert bench.reason == "ft-stale"


def test_a_later_fault_never_makes_the_reaction_milder(bench):
    bench.enter(ArmState.FLOAT)
    bench.arm.qd = np.full(7, 1.6)
    bench.run()
    bench.arm.qd = np.zeros(7)
    bench.arm.missing = 6
    bench.run()
    assert (bench.state, bench.reasons) == (
        ArmState.DAMP,
        ["can-silence", "overspeed"],  # a fault that ends the session is reported first
    )


def test_a_worse_fault_replaces_the_first(bench):
    bench.enter(ArmState.FLOAT)
    bench.cycle.is_recording = True
    bench.law.offset = 0.06
    bench.run()
    bench.arm.qd = np.full(7, 1.6)
    bench.run()
    assert (bench.state, bench.reason) == (ArmState.DAMP, "overspeed")


def test_a_lasting_fault_enters_its_state_once(bench):
    bench.enter(ArmState.FLOAT)
    bench.arm.qd = np.full(7, 1.6)
    bench.run(5)
    assert bench.law.entered == [ArmState.FLOAT, ArmState.DAMP]


def test_a_new_request_clears_the_verdict(bench):
    bench.enter(ArmState.FLOAT)
    bench.arm.qd = np.full(7, 1.6)
    bench.run()
    bench.arm.qd = np.zeros(7)
    bench.enter(ArmState.HOLD)
    assert (bench.state, bench.reason) == (ArmState.HOLD, "")


def test_silence_of_the_pucks_holds_and_then_idles(bench):
    bench.enter(ArmState.FLOAT)
    for missing in range(1, 26):
        bench.arm.missing = missing
        bench.run()
        expected = ArmState.FLOAT if missing < 5 else ArmState.HOLD
        assert bench.state is (expected if missing < 25 else ArmState.IDLE)
    assert bench.arm.idled == 1
    assert bench.reason == "can-silence"


def test_a_confirmed_idle_is_idle_with_zero_torque(bench):
    bench.enter(ArmState.FLOAT)
    bench.arm.mode = SafetyMode.E_STOP
    record = bench.run()
    assert (bench.state, bench.reason) == (ArmState.IDLE, "estop")
    assert record["torque_command"].tolist() == [0.0] * 7


def test_idle_in_the_middle_of_a_silence_is_recorded_as_zero_torque(bench):
    bench.enter(ArmState.FLOAT)
    bench.arm.missing = 25
    assert bench.run()["torque_command"].tolist() == [0.0] * 7


def test_an_unconfirmed_idle_is_unknown_and_keeps_the_torque(bench):
    bench.enter(ArmState.FLOAT)
    sent = len(bench.arm.sent)
    bench.arm.is_confirmed = False
    bench.arm.q = np.full(7, np.nan)
    record = bench.run()
    bench.arm.q = np.zeros(7)
    bench.run(5)
    assert bench.state is ArmState.UNKNOWN
    assert len(bench.arm.sent) == sent  # zero torque in ACTIVE would be free fall
    assert record["torque_command"].tolist() == [1.0] * 7


@pytest.mark.parametrize(
    ("is_confirmed", "state"), [(True, ArmState.IDLE), (False, ArmState.UNKNOWN)]
)
def test_idle_on_request_is_confirmed_or_unknown(bench, is_confirmed, state):
    bench.enter(ArmState.FLOAT)
    bench.arm.is_confirmed = is_confirmed
    bench.enter(ArmState.IDLE)
    assert bench.state is state


@pytest.mark.parametrize("mode", [SafetyMode.IDLE, SafetyMode.E_STOP])
def test_an_unknown_arm_is_idle_when_the_module_confirms_later(bench, mode):
    bench.enter(ArmState.FLOAT)
    bench.arm.is_confirmed = False
    bench.enter(ArmState.IDLE)
    bench.arm.mode = SafetyMode.UNKNOWN
    bench.run(10)
    assert bench.state is ArmState.UNKNOWN
    bench.arm.mode, bench.arm.is_confirmed = mode, True
    sent = len(bench.arm.sent)
    bench.run()
    assert bench.state is ArmState.IDLE
    record = bench.run()
    assert len(bench.arm.sent) == sent
    assert not record["torque_command"].any()


def test_a_velocity_warning_is_flagged_and_changes_nothing(bench):
    bench.enter(ArmState.FLOAT)
    bench.cycle.is_recording = True
    assert not has(bench.run(), Flag.SAFETY_WARNING)
    bench.arm.warnings = ("velocity",)
    record = bench.run(10)
    assert has(record, Flag.SAFETY_WARNING)
    assert not has(record, Flag.SAFETY_FAULT)
    assert (bench.state, bench.reason) == (ArmState.FLOAT, "")
    assert bench.cycle.is_recording


def test_a_fault_of_the_safety_module_is_flagged_and_named_as_the_cause(bench):
    bench.enter(ArmState.FLOAT)
    assert not has(bench.run(), Flag.SAFETY_FAULT)
    bench.arm.mode, bench.arm.faults = SafetyMode.IDLE, ("velocity",)
    assert has(bench.run(), Flag.SAFETY_FAULT)
    assert bench.reason == "pendant-idle"
    assert bench.cycle.status.verdict.detail == CircuitCauses(("velocity",))


def test_a_stop_by_the_guard_has_no_module_cause(bench):
    bench.enter(ArmState.FLOAT)
    bench.arm.faults = ("heartbeat",)
    bench.arm.missing = 25
    bench.run()
    assert bench.reason == "can-silence"
    assert bench.cycle.status.verdict.detail == ReplySilence(50.0, 0b1000000)


def test_an_unknown_arm_can_be_held_again(bench):
    bench.enter(ArmState.FLOAT)
    bench.arm.is_confirmed = False
    bench.enter(ArmState.IDLE)
    bench.enter(ArmState.HOLD)
    assert bench.state is ArmState.HOLD
    assert bench.arm.sent[-1].tolist() == [2.0] * 7


def test_torques_are_sent_before_activation_at_the_pendant(bench):
    bench.start()
    bench.run(10)
    assert (bench.state, bench.reason) == (ArmState.HOLD, "")
    assert bench.arm.sent[-1].tolist() == [2.0] * 7


def test_idle_at_the_pendant_after_activation_is_a_verdict(bench):
    bench.start()
    bench.arm.mode = SafetyMode.ACTIVE
    bench.run()
    bench.arm.mode = SafetyMode.IDLE
    bench.run()
    assert (bench.state, bench.reason) == (ArmState.IDLE, "pendant-idle")


@pytest.mark.parametrize("state", sorted(TORQUE))
def test_a_braked_arm_gets_no_torque_but_at_a_start(bench, state):
    bench.arm.mode = SafetyMode.IDLE
    bench.run()
    bench.enter(state)
    assert (bench.state, bench.reason) == (ArmState.IDLE, "arm-not-active")


def fault(name):
    """Return a fault that another process reports."""
    return verdict_for(Fault(name))


def test_a_request_unaware_of_the_newest_verdict_is_refused(bench):
    bench.enter(ArmState.FLOAT)
    known = bench.cycle.status.number
    bench.cycle.report(fault("console-silent"))
    bench.run()
    bench.cycle.request(ArmState.FLOAT, known)
    bench.run()
    assert (bench.state, bench.reason) == (ArmState.HOLD, "console-silent")
    bench.cycle.request(ArmState.FLOAT, bench.cycle.status.number)
    bench.run()
    assert (bench.state, bench.reason) == (ArmState.FLOAT, "")


def test_a_pending_request_is_refused_by_an_intervening_verdict(bench):
    bench.enter(ArmState.FLOAT)
    bench.arm.missing = 1
    bench.enter(ArmState.HOLD)
    bench.cycle.report(fault("console-silent"))
    bench.run()
    bench.arm.missing = 0
    bench.run()
    assert (bench.state, bench.reason) == (ArmState.HOLD, "console-silent")


def test_a_start_overtaken_by_a_verdict_sends_no_torque(bench):
    bench.arm.mode = SafetyMode.IDLE
    bench.run()
    bench.arm.missing = 1
    bench.cycle.start()
    bench.cycle.report(fault("console-silent"))
    bench.run()
    bench.arm.missing = 0
    bench.run()
    bench.enter(ArmState.HOLD)
    assert (bench.state, bench.reason) == (ArmState.IDLE, "arm-not-active")


@pytest.mark.parametrize("state", sorted(TORQUE))
def test_a_start_that_is_withdrawn_permits_no_later_torque(bench, state):
    bench.arm.mode = SafetyMode.IDLE
    bench.run()
    bench.cycle.start()
    bench.run()
    bench.enter(ArmState.IDLE)
    bench.enter(state)
    assert (bench.state, bench.reason) == (ArmState.IDLE, "arm-not-active")


def test_an_idling_verdict_stays_latched_after_a_later_one():
    status = ControlStatus()
    status.latch(replace(fault("console-silent"), action=Action.IDLE))
    status.latch(fault("can-silence"))
    assert status.verdict.action is Action.HOLD  # reported first
    assert status.is_idled


@pytest.mark.parametrize("state", sorted(TORQUE))
def test_an_idling_verdict_stays_active_until_a_start(bench, state):
    bench.enter(ArmState.FLOAT)
    bench.cycle.report(fault("motor-stuck"))
    bench.run()
    for wanted in (state, ArmState.IDLE):
        bench.enter(wanted)
        assert (bench.state, bench.reason) == (ArmState.IDLE, "motor-stuck")
    bench.start()
    assert (bench.state, bench.reason) == (ArmState.HOLD, "")


@pytest.mark.parametrize(
    ("first", "second"),
    [("console-silent", "motor-stuck"), ("motor-stuck", "console-silent")],
)
def test_of_two_verdicts_the_stricter_comes_first_and_both_remain(bench, first, second):
    bench.enter(ArmState.FLOAT)
    for name in (first, second):
        bench.cycle.report(fault(name))
        bench.run()
    faults = [verdict.fault for verdict in bench.cycle.status.active_verdicts]
    assert faults == [Fault.MOTOR_STALLED, Fault.CONSOLE_SILENT]
    assert (bench.state, bench.cycle.status.number) == (ArmState.IDLE, 2)


def test_a_fault_that_persists_is_one_verdict(bench):
    bench.enter(ArmState.FLOAT)
    for _ in range(3):
        bench.cycle.report(fault("console-silent"))
        bench.run()
    assert bench.cycle.status.number == 1


def test_the_status_shows_the_age_of_the_force(bench):
    bench.run()
    bench.run(3, force=None)
    assert bench.cycle.status.ft_age_ns == 3 * PERIOD_NS


def test_a_sensor_without_its_port_counts_as_silent(bench):
    def gone(now_ns):
        raise LinkError("The serial port of the F/T sensor failed.")

    bench.enter(ArmState.FLOAT)
    bench.cycle.is_recording = True
    bench.sensor.poll = gone
    bench.run(15, force=None)  # 30 ms, the limit is 20
    assert (bench.state, bench.reason) == (ArmState.HOLD, "ft-stale")
    assert len(bench.records) == 16


@pytest.mark.parametrize(
    ("mode", "state", "reason"),
    [
        (SafetyMode.IDLE, ArmState.HOLD, ""),  # it waits for the pendant
        (SafetyMode.E_STOP, ArmState.IDLE, "estop"),
    ],
)
def test_a_stop_is_reported_before_the_first_activation(bench, mode, state, reason):
    bench.start()
    bench.arm.mode = mode
    bench.run()
    assert (bench.state, bench.reason) == (state, reason)


def fall_silent(bench):
    """Let the safety module give no answer from now on."""
    bench.arm.mode, bench.arm.safety_heard_ns = SafetyMode.UNKNOWN, bench.now_ns


def test_a_silent_safety_module_makes_the_arm_hold_at_once_and_idle_later(bench):
    bench.enter(ArmState.FLOAT)
    fall_silent(bench)
    bench.arm.safety_heard_ns -= 250 * MS
    bench.run()
    assert (bench.state, bench.reason) == (ArmState.HOLD, "safety-silent")
    assert bench.arm.idled == 0
    bench.run(150 * MS // PERIOD_NS)
    assert bench.arm.idled == 1
    assert bench.cycle.status.verdict.ends_session


def test_a_request_does_not_reset_the_silence_of_a_module(bench):
    bench.enter(ArmState.HOLD)
    fall_silent(bench)
    bench.enter(ArmState.FLOAT)
    assert (bench.state, bench.reason) == (ArmState.HOLD, "safety-silent")
    bench.arm.qd = np.full(7, 1.6)
    bench.run()
    assert (bench.state, bench.reasons) == (
        ArmState.DAMP,
        ["safety-silent", "overspeed"],
    )


def test_a_hold_ends_if_the_safety_module_never_replied(bench):
    bench.arm.safety_heard_ns, bench.arm.mode = 0, SafetyMode.UNKNOWN
    bench.arm.is_confirmed = False
    bench.enter(ArmState.HOLD)
    assert (bench.state, bench.reason) == (ArmState.UNKNOWN, "safety-silent")


def test_a_simultaneous_request_does_not_hide_idle_at_the_pendant(bench):
    bench.enter(ArmState.HOLD)
    bench.arm.mode = SafetyMode.IDLE
    bench.enter(ArmState.FLOAT)
    assert (bench.state, bench.reason) == (ArmState.IDLE, "pendant-idle")


def test_the_command_after_a_verdict_is_within_limits_too(bench):
    bench.enter(ArmState.FLOAT)
    bench.law.torques = TORQUE | {ArmState.DAMP: 47.8}
    bench.arm.qd = np.full(7, 1.6)
    sent = [bench.run()["torque_command"][0] for _ in range(12)]
    assert bench.state is ArmState.DAMP
    assert sent[:3] == pytest.approx([4.0, 7.0, 10.0])
    assert max(sent) == LIMITS.torque[0]


def test_torques_grow_from_zero_after_the_brakes(bench):
    bench.law.torques = dict.fromkeys(TORQUE, 9.0)
    bench.enter(ArmState.FLOAT)
    bench.run(5)
    record = bench.enter(ArmState.IDLE)
    assert not record["torque_command"].any()
    bench.start()
    assert bench.arm.sent[-1].tolist() == pytest.approx([3.0] * 6 + [9.0])


def test_a_slew_limited_torque_is_flagged(bench):
    bench.law.torques = dict.fromkeys(TORQUE, 9.0)
    assert has(bench.enter(ArmState.FLOAT), Flag.TORQUE_CLIPPED)
    assert not has(bench.run(3), Flag.TORQUE_CLIPPED)


def test_an_unknown_arm_is_not_polled_until_torques_are_requested(bench):
    bench.enter(ArmState.FLOAT)
    bench.arm.is_confirmed = False
    bench.enter(ArmState.IDLE)
    asked_ns = bench.arm.asked_ns
    bench.run(100)
    assert bench.arm.asked_ns == asked_ns
    bench.enter(ArmState.HOLD)
    assert bench.arm.asked_ns > asked_ns
    assert bench.state is ArmState.HOLD


@pytest.fixture
def held(bench):
    """A held arm whose control law accepts any powered test and does nothing."""
    bench.law.start_powered_test = lambda goal, reading: None
    bench.law.is_testing = lambda: True
    bench.law.powered_test_excess = lambda reading, energy, is_powered: None
    bench.enter(ArmState.HOLD)
    return bench


def silent(bench, cycles):
    """Run cycles in which no puck answers."""
    for _ in range(cycles):
        bench.arm.missing += 1
        bench.run()


def test_a_heartbeat_test_sends_no_requests_until_it_ends(held):
    held.cycle.start_powered_test(PoweredTestGoal(PoweredTestKind.SILENCE, seconds=0.1))
    held.run()
    asked_ns = held.arm.asked_ns
    silent(held, 49)
    assert held.arm.asked_ns == asked_ns
    assert (held.reason, held.state) == ("", ArmState.HOLD)
    held.arm.missing = 0
    held.run()
    assert held.arm.asked_ns > asked_ns
    silent(held, LIMITS.idle_after_missing)  # unintended silence
    assert held.reason == Fault.CAN_SILENCE


def test_an_intended_silence_hides_no_other_fault(held):
    held.cycle.start_powered_test(PoweredTestGoal(PoweredTestKind.SILENCE, seconds=0.1))
    held.run()
    silent(held, 10)
    held.arm.mode = SafetyMode.E_STOP
    silent(held, 1)
    assert held.reason == Fault.E_STOP


def test_a_request_ends_an_intended_silence(held):
    held.cycle.start_powered_test(PoweredTestGoal(PoweredTestKind.SILENCE, seconds=0.1))
    held.run()
    asked_ns = held.arm.asked_ns
    held.enter(ArmState.HOLD)
    assert held.arm.asked_ns > asked_ns


def test_the_status_before_the_first_cycle_is_idle_without_a_verdict(bench):
    assert bench.cycle.replies_ns == 0
    status = bench.cycle.status
    assert (status.state, status.safety) == (ArmState.IDLE, SafetyMode.UNKNOWN)
    assert (status.verdict, status.ft_age_ns) == (None, 0)


def test_the_wait_for_the_first_force_begins_with_the_first_cycle(bench):
    bench.cycle.is_recording = True
    bench.cycle.request(ArmState.FLOAT)
    bench.run(force=None)
    assert (bench.cycle.status.ft_age_ns, bench.reason) == (0, "")
    bench.run(2, force=None)
    assert bench.cycle.status.ft_age_ns == 2 * PERIOD_NS


class Loaded(Observer):
    """Copies the whole wrench to the sample, and keeps the bias."""

    def set_bias(self, bias):
        self.bias = bias

    def observe(self, reading, wrench, sample):
        if wrench is not None:
            sample.wrench[:] = wrench.wrench
        return super().observe(reading, wrench, sample)


@pytest.mark.parametrize("is_tared", [True, False])
def test_a_load_is_judged_only_after_a_tare(bench, is_tared):
    bench.observer = Loaded()
    bench.cycle = bench.make()
    bench.enter(ArmState.FLOAT)
    if is_tared:
        bench.cycle.set_bias((0.0,) * 6)
        assert bench.observer.bias == (0.0,) * 6
    bench.run(10, force=200.0)
    assert bench.reason == ("contact-force" if is_tared else "")


def test_a_load_is_not_judged_from_a_force_that_is_not_fresh(bench):
    bench.observer = Loaded()
    bench.cycle = bench.make()
    bench.enter(ArmState.FLOAT)
    bench.cycle.set_bias((0.0,) * 6)
    bench.run(2, force=200.0)
    bench.run(10, force=None)
    assert bench.reason == ""


def test_of_two_equal_verdicts_the_guards_own_is_reported(bench):
    bench.enter(ArmState.FLOAT)
    bench.cycle.is_recording = True
    bench.law.offset = 0.06
    bench.cycle.report(verdict_for(Fault.CONSOLE_SILENT))
    bench.run()
    assert (bench.state, bench.reason) == (ArmState.HOLD, "joint7-slip")


def test_a_fault_of_the_same_severity_does_not_replace_the_first(bench):
    bench.enter(ArmState.FLOAT)
    bench.run(300)  # its activation is over
    bench.arm.qd = np.full(7, 1.6)
    bench.run()
    bench.arm.qd = np.zeros(7)
    bench.observer.speed = 2.0
    bench.run(3)
    assert bench.reason == "overspeed"
    bench.enter(ArmState.HOLD)
    bench.run(2)
    assert bench.reason == "foot-speed"  # it was there all the time


class PoweredTestLaw(Law):
    """A law in a powered test; keeps whether the motors were reported as powered."""

    def __init__(self):
        super().__init__()
        self.excess = None
        self.powered = []

    def is_testing(self):
        return True

    def powered_test_excess(self, reading, energy, *, is_powered):
        self.powered.append(is_powered)
        return self.excess


@pytest.fixture
def testing():
    bench = Bench()
    bench.law = PoweredTestLaw()
    bench.cycle = bench.make()
    bench.enter(ArmState.HOLD)
    return bench


def test_a_powered_test_continues_while_the_arm_behaves(testing):
    testing.run(3)
    assert (testing.state, testing.reason) == (ArmState.HOLD, "")
    assert testing.law.powered[-1]
    testing.arm.mode = SafetyMode.IDLE
    testing.run()
    assert not testing.law.powered[-1]


def test_an_excess_in_a_powered_test_ends_in_idle(testing):
    testing.law.excess = MotionExcess("the travel of joint 4", 0.03, 0.025, "rad")
    testing.run()
    assert (testing.state, testing.reason) == (ArmState.IDLE, Fault.POWERED_TEST_MOTION)
    assert testing.cycle.status.verdict.detail == testing.law.excess


def test_a_guard_verdict_takes_precedence_and_idles_a_powered_test(testing):
    testing.law.excess = MotionExcess("the travel of joint 4", 0.03, 0.025, "rad")
    testing.arm.missing = 5
    testing.run()
    assert (testing.state, testing.reason) == (ArmState.IDLE, Fault.CAN_SILENCE)
