"""The tare between two trials, and the forces that it must not hide."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from acquisition.control_loop.faults import Action, Fault, GuardVerdict
from acquisition.control_loop.states import ArmState
from acquisition.devices import WrenchSample
from acquisition.errors import PreflightError
from acquisition.ipc.ring_buffer import RingBuffer
from acquisition.ipc.shared_sensor import WRENCH_DTYPE, pack_wrench
from acquisition.sample import Sample
from experiments.operator.console import GOOD
from experiments.operator.prompts import Prompt
from experiments.rig.build import build_tool
from experiments.run.fault_plan import FaultTrigger
from experiments.run.stop import StopRequestedError
from experiments.run.tare import (
    LIFTED,
    MAX_TARES,
    STILL_SPEED,
    known_bias,
    residual_force,
    take_end_tare,
    take_tare,
    verify_mounting,
)
from experiments.session.sidecar import TrialName
from experiments.session.states import Event
from experiments.settings.load import load_settings
from ft_sensor.calibration.fit import SensorFit
from ft_sensor.calibration.sensor_file import SensorCalibration, sensor_to_toml
from ft_sensor.payload import Payload
from tests.experiments.run.bench import Keys, StubClient, make_context
from wam.control.position_control import JointMove, move_reference
from wam.model.arm_model import ArmModel
from wam.model.constants import load_constants

BIAS = np.array([0.5, -1.0, 2.0, 0.01, 0.02, 0.03])


def calibration(foot):
    fit = SensorFit(0.45, np.zeros(3), BIAS, 0.0, 1.0, 0.01, 0.001)
    calibrated = SensorCalibration(
        fit, foot, 0.0, "2027-01-01T00:00:00Z", False, np.eye(3)[None], BIAS[None]
    )
    return {"calibration:ft_sensor.toml": sensor_to_toml(calibrated)}


def payload(mass):
    return Payload(mass, np.zeros(3), np.eye(3), 1.0, np.zeros(6))


def test_the_bias_of_a_calibrated_sensor_is_known_with_its_foot_only():
    known = known_bias(calibration("tread"), "tread", is_simulated=False)
    np.testing.assert_array_equal(known, BIAS)
    assert known_bias(calibration("tread"), "bare", is_simulated=False) is None


def test_the_wrist_is_not_turned_for_an_uncalibrated_sensor(tmp_path):
    context = make_context(tmp_path, Keys())
    context.rig.settings.calibrations, context.rig.row.foot = {}, "tread"
    verify_mounting(context)
    assert (context.loop_client.requested, context.loop_client.advanced) == ([], 0.0)


def test_the_bias_of_an_uncalibrated_real_sensor_is_unknown():
    assert known_bias({}, "tread", is_simulated=False) is None
    assert known_bias({"rig": "bias = 1"}, "tread", is_simulated=False) is None


def test_an_uncalibrated_simulated_sensor_has_no_bias():
    np.testing.assert_array_equal(known_bias({}, "tread", is_simulated=True), 0.0)


def test_a_wrong_mass_of_the_foot_shows_as_a_residual_force():
    truth, believed = payload(0.45), payload(0.40)
    reading = BIAS + truth.weight(np.eye(3))
    right = truth.tared(reading, np.eye(3))
    wrong = believed.tared(reading, np.eye(3))
    assert residual_force(right, BIAS) == pytest.approx(0.0, abs=1e-12)
    assert residual_force(wrong, BIAS) == pytest.approx(0.05 * 9.81, rel=1e-3)


class LiftedFoot(StubClient):
    """Loop whose foot hangs still in the air, with a streaming sensor.

    Attributes:
        height: height of the foot above the plane [m], by seconds since the start.
        speed: velocity of the foot, linear and angular [m/s, rad/s].
        force: force along x [N], by seconds since the start.
        is_valid: whether the sensor marks its samples as valid.
    """

    def __init__(self, clock):
        super().__init__(clock)
        self.height = self.force = lambda seconds: 0.1
        self.speed = (0.0,) * 6
        self.is_valid = True
        self.bias = None
        self.buffer = RingBuffer(
            memoryview(bytearray(RingBuffer.size_of(WRENCH_DTYPE, 4096))),
            WRENCH_DTYPE,
            4096,
        )
        self.on_advance.append(self._stream)

    def _stream(self):
        now = self.clock.now_ns()
        for t_ns in range(now - 20_000_000, now, 2_000_000):
            wrench = (self.force(self.advanced), 0.0, 0.0, 0.0, 0.0, 0.0)
            sample = WrenchSample(t_ns, 0, wrench, 0, self.is_valid, 0)
            self.buffer.write(pack_wrench(sample))

    def latest(self):
        sample = Sample()
        sample.foot_position[2] = self.height(self.advanced)
        sample.foot_velocity[:] = self.speed
        return sample.data

    def wrenches(self):
        return self.buffer.reader()

    def set_bias(self, bias):
        self.bias = bias


def lifted(tmp_path, *keys, mass=0.0, residual=0.5, calibrations=None):
    """Context of a lifted foot whose mass is set to `mass` [kg]."""
    context = make_context(tmp_path, Keys(*keys))
    rig = context.rig
    rig.backend.loop_client = LiftedFoot(rig.clock)
    rig.frame = SimpleNamespace(height=lambda position: position[2])
    rig.model = SimpleNamespace(sole_pose=lambda q: (np.zeros(3), np.eye(3)))
    rig.payload, rig.is_simulated = payload(mass), True
    rig.row = SimpleNamespace(name="TF", foot="tread", reset=())
    rig.settings = SimpleNamespace(
        calibrations=calibrations or {},
        rig=SimpleNamespace(limits=SimpleNamespace(tare_spread=0.5, residual=residual)),
    )
    return context


def events(context, event):
    return [e for e in context.metadata.folder.events() if e["event"] == event]


def test_a_tare_passes_its_bias_to_loop_rig_and_journal(tmp_path):
    context = lifted(tmp_path)
    take_tare(context, TrialName(2, 1))
    right = pytest.approx([0.1, 0, 0, 0, 0, 0])
    assert context.loop_client.bias == right
    assert context.rig.tared.bias == right
    (event,) = events(context, Event.TARED)
    assert (event["bias"], event["spread"]) == (right, 0.0)
    assert event["trial_number"] == 2


def test_the_foot_is_guided_until_it_is_still_and_then_held(tmp_path):
    context = lifted(tmp_path)
    take_tare(context, TrialName(1, 1))
    assert context.loop_client.requested == [ArmState.GUIDE, ArmState.HOLD]
    assert context.loop_client.advanced == pytest.approx(0.3 + 1.02, abs=0.03)


def keep_first(context):
    """Record and keep a first trial."""
    for name in (Event.TRIAL_STARTED, Event.TRIAL_RECORDED, Event.TRIAL_KEPT):
        context.journal.append(name, trial=1, attempt=1)


def test_only_the_first_tare_after_a_trial_is_written_to_its_sidecar(tmp_path):
    context = lifted(tmp_path)
    keep_first(context)
    sidecar = context.metadata.folder.trials / "T01.json"
    take_tare(context, TrialName(2, 1))
    written = json.loads(sidecar.read_text())
    assert written["verdict"] == "keep"
    assert written["next_tare"] == {
        "t_ns": context.rig.tared_ns,
        "bias": context.rig.tared.bias.tolist(),
    }
    take_tare(context, TrialName(2, 1))
    assert context.rig.tared_ns > written["next_tare"]["t_ns"]
    assert json.loads(sidecar.read_text()) == written


@pytest.mark.parametrize(("moved", "is_reported"), [(1.9, False), (2.1, True)])
def test_a_zero_that_moved_between_two_tares_is_reported(
    tmp_path, capsys, moved, is_reported
):
    context = lifted(tmp_path, residual=5.0)
    take_tare(context, TrialName(1, 1))
    keep_first(context)
    context.loop_client.force = lambda seconds: 0.1 + moved
    take_tare(context, TrialName(2, 1))
    words = f"T01: the sensor's zero moved by {moved} N"
    assert (words in capsys.readouterr().out) is is_reported


def test_a_refused_tare_doubts_the_zero_of_the_trial_before_it(tmp_path, capsys):
    """The sensor recovers before the next tare, which would not show it."""
    context = lifted(tmp_path, residual=1.0)
    take_tare(context, TrialName(1, 1))
    keep_first(context)
    begun = context.loop_client.advanced
    context.loop_client.force = lambda now: 2.3 if now < begun + 3.0 else 0.1
    take_tare(context, TrialName(2, 1))
    words = "the sensor's zero moved by 2.2 N"
    assert capsys.readouterr().out.count(f"T01: {words}") == 1
    (note,) = context.journal.state.attempt_at(TrialName(1, 1)).notes
    assert note["text"].startswith(words)


def test_the_zero_of_an_earlier_opening_is_not_compared(tmp_path, capsys):
    context = lifted(tmp_path, residual=50.0)
    take_tare(context, TrialName(1, 1))
    keep_first(context)
    context.journal.append(Event.ENDED, reason="unfinished")
    context.journal.append(Event.RESUMED)
    context.journal.append(Event.ACTIVATED)
    context.loop_client.force = lambda seconds: 20.0
    take_tare(context, TrialName(2, 1))
    assert "zero moved" not in capsys.readouterr().out
    sidecar = context.metadata.folder.trials / "T01.json"
    assert "next_tare" not in json.loads(sidecar.read_text())


def test_the_operator_is_asked_to_lift_during_the_whole_tare(tmp_path):
    context = lifted(tmp_path)
    take_tare(context, TrialName(3, 2))
    asked = {(s.prompt, s.trial, s.attempt) for s in context.operator.states}
    assert asked == {(Prompt.LIFT, 3, 2)}


@pytest.mark.parametrize(("share", "waits"), [(1.03, False), (1.0, True), (0.97, True)])
def test_a_foot_counts_as_lifted_above_the_minimum_height(tmp_path, share, waits):
    context = lifted(tmp_path)
    context.loop_client.height = lambda s: 0.1 if s > 1.0 else share * LIFTED
    take_tare(context, TrialName(1, 1))
    assert (context.loop_client.advanced > 2.0) is waits


@pytest.mark.parametrize(
    ("speed", "is_still"),
    [
        ((0.9 * STILL_SPEED, 0, 0, 0, 0, 0), True),
        ((-0.9 * STILL_SPEED, 0, 0, 0, 0, 0), True),
        ((0, 1.1 * STILL_SPEED, 0, 0, 0, 0), False),
        ((0, 0, -1.1 * STILL_SPEED, 0, 0, 0), False),
        ((STILL_SPEED, 0, 0, 0, 0, 0), False),
        ((0, 0, -STILL_SPEED, 0, 0, 0), False),
        ((0, 0, 0, 1.0, 0, 0), True),
    ],
)
def test_a_foot_counts_as_still_below_the_speed_limit(tmp_path, speed, is_still):
    keys = [""] * 100 + ["q"]
    context = lifted(tmp_path, *keys)
    context.loop_client.speed = speed
    if is_still:
        take_tare(context, TrialName(1, 1))
        return
    with pytest.raises(StopRequestedError):
        take_tare(context, TrialName(1, 1))
    assert context.loop_client.requested == [ArmState.GUIDE]


def test_a_foot_that_touches_meanwhile_must_be_still_again(tmp_path):
    context = lifted(tmp_path)
    context.loop_client.height = lambda s: 0.0 if 0.19 < s < 0.21 else 0.1
    take_tare(context, TrialName(1, 1))
    assert context.loop_client.advanced == pytest.approx(0.2 + 0.3 + 1.02, abs=0.03)


def test_a_tare_with_a_varying_force_is_repeated_automatically(tmp_path, capsys):
    context = lifted(tmp_path)
    context.loop_client.force = lambda s: 3.0 if 0.8 < s < 1.2 else 0.1
    take_tare(context, TrialName(1, 1))
    assert len(events(context, Event.TARED)) == 1
    assert context.loop_client.bias[0] == pytest.approx(0.1)
    assert "limit 0.5" in capsys.readouterr().err


def test_too_many_refused_tares_end_the_session(tmp_path, capsys):
    context = lifted(tmp_path)
    context.loop_client.force = lambda s: 3.0 * (s % 0.5)
    with pytest.raises(PreflightError, match="Force varied"):
        take_tare(context, TrialName(1, 1))
    assert context.loop_client.requested.count(ArmState.GUIDE) == MAX_TARES
    assert capsys.readouterr().err.count("Force varied") == MAX_TARES - 1
    assert events(context, Event.TARED) == []


def test_flagged_samples_are_reported_when_a_tare_is_refused(tmp_path):
    context = lifted(tmp_path)
    context.loop_client.is_valid = False
    with pytest.raises(PreflightError, match="flagged"):
        take_tare(context, TrialName(1, 1))


@pytest.mark.parametrize(("limit", "is_taken"), [(0.48, False), (0.50, True)])
def test_a_tare_that_hides_a_force_of_the_foot_is_refused(tmp_path, limit, is_taken):
    """A mass set 50 g too high leaves 0.49 N at the sensor."""
    context = lifted(tmp_path, mass=0.05, residual=limit)
    context.loop_client.force = lambda s: 0.0
    if is_taken:
        take_tare(context, TrialName(1, 1))
        return
    with pytest.raises(PreflightError, match="residual"):
        take_tare(context, TrialName(1, 1))
    assert context.loop_client.bias is None


@pytest.mark.parametrize(("limit", "is_taken"), [(0.5, True), (0.499, False)])
def test_a_tare_may_hide_a_force_up_to_the_limit(tmp_path, limit, is_taken):
    context = lifted(tmp_path, residual=limit)
    context.loop_client.force = lambda s: 0.5
    if is_taken:
        take_tare(context, TrialName(1, 1))
        return
    with pytest.raises(PreflightError, match="residual"):
        take_tare(context, TrialName(1, 1))


def test_the_residual_is_measured_against_the_calibration_of_this_foot(tmp_path):
    context = lifted(tmp_path, residual=0.1, calibrations=calibration("tread"))
    context.loop_client.force = lambda s: float(BIAS[0])
    with pytest.raises(PreflightError):  # y and z are not those of the calibration
        take_tare(context, TrialName(1, 1))


def test_planned_faults_are_due_at_every_tick_of_a_tare(tmp_path):
    context = lifted(tmp_path)
    due = []
    context.console_loop.faults = SimpleNamespace(
        inject_due=lambda *given: due.append(given)
    )
    take_tare(context, TrialName(4, 1))
    assert {(moment, number) for moment, number, _ in due} == {(FaultTrigger.TARE, 4)}
    assert [seconds for *_, seconds in due[1:]] == pytest.approx(
        [tick * 0.02 for tick in range(51)]
    )


def test_the_end_tare_is_recorded_in_the_journal(tmp_path, capsys):
    context = lifted(tmp_path)
    take_end_tare(context)
    (event,) = events(context, Event.TARED)
    assert event["trial_number"] == 0
    assert "No tare at the end" not in capsys.readouterr().out
    asked = {(s.prompt, s.trial, s.attempt) for s in context.operator.states}
    assert asked == {(Prompt.LIFT, 0, 1)}


def test_the_end_tare_may_be_left_out(tmp_path, capsys):
    context = lifted(tmp_path, "q")
    take_end_tare(context)
    assert "No tare at the end: left out" in capsys.readouterr().out


def test_a_fault_during_the_end_tare_is_only_reported(tmp_path, capsys):
    context = lifted(tmp_path)
    context.loop_client.status.verdict = GuardVerdict(Action.IDLE, Fault.E_STOP)
    take_end_tare(context)
    assert "No tare at the end: Stop pressed" in capsys.readouterr().out


def test_a_refused_end_tare_is_only_reported(tmp_path, capsys):
    context = lifted(tmp_path)
    context.loop_client.is_valid = False
    take_end_tare(context)
    assert "flagged" in capsys.readouterr().out


def test_a_tare_without_sensor_data_names_the_cause(tmp_path, capsys):
    context = lifted(tmp_path)
    context.loop_client.is_valid = False
    context.rig.backend.stream = {"trouble": "Another F/T sensor was plugged in: 7."}
    take_end_tare(context)
    out = capsys.readouterr().out
    assert "not being read: Another F/T sensor was plugged in: 7." in out
    assert "flagged" not in out


def test_other_settings_files_are_not_read_as_a_calibration():
    text = calibration("tread")["calibration:ft_sensor.toml"]
    assert known_bias({"rig": text}, "tread", is_simulated=False) is None
    container = {"calibration:terrain.toml": "name = 1"}
    assert known_bias(container, "tread", is_simulated=False) is None


def test_the_journal_has_the_bias_that_the_loop_uses(tmp_path):
    context = lifted(tmp_path)
    context.loop_client.force = lambda s: 0.1 + 1.23456e-4 + 0.1003456 * (s > 0.8)
    take_tare(context, TrialName(1, 1))
    (event,) = events(context, Event.TARED)
    assert event["bias"] == context.loop_client.bias
    assert event["t_ns"] == context.rig.tared_ns
    assert event["spread"] == pytest.approx(0.1, abs=0.02)
    assert event["spread"] == round(event["spread"], 3)


class TurnedWrist(LiftedFoot):
    """Arm that moves where it is sent, with a sensor that weighs its foot.

    Attributes:
        seen: force at the sensor [N], shape (3,), by joint positions.
    """

    def __init__(self, clock, start, seen):
        super().__init__(clock)
        self.move, self.begun_ns = JointMove(start, start), 0
        self.seen = seen

    @property
    def position(self):
        return move_reference(self.move, (self.clock.now_ns() - self.begun_ns) * 1e-9)[
            0
        ]

    def move_to(self, goal, speed):
        self.move = JointMove(self.position, np.array(goal), speed)
        self.begun_ns = self.clock.now_ns()

    def _stream(self):
        now, force = self.clock.now_ns(), self.seen(self.position)
        for t_ns in range(now - 20_000_000, now, 2_000_000):
            sample = WrenchSample(t_ns, 0, (*force, 0.0, 0.0, 0.0), 0, True, 0)
            self.buffer.write(pack_wrench(sample))

    def latest(self):
        sample = Sample()
        sample.position[:] = self.position
        sample.data["host_ns"] = self.clock.now_ns()
        return sample.data

    def last(self, seconds):
        return np.concatenate([self.latest(), self.latest()])


class Bystander(Keys):
    """Operator who confirms every request and waits otherwise."""

    def answer(self, state):
        self.states.append(state)
        return {Prompt.MOVE: "g", Prompt.SUPPORT: " "}.get(state.prompt, "")


def wrist(tmp_path, carried, seen, residual=1.0):
    """Context whose arm can turn its wrist, with a calibrated sensor."""
    context = make_context(tmp_path, Bystander())
    shipped, rig = load_settings(None), context.rig
    limits = shipped.rig.limits.model_copy(update={"residual": residual})
    rig.settings = SimpleNamespace(
        calibrations=calibration("tread"),
        matrix=shipped.matrix,
        rig=shipped.rig.model_copy(update={"limits": limits}),
    )
    rig.row = next(row for row in shipped.matrix.terrains if row.foot == "tread")
    rig.model = ArmModel(load_constants(), build_tool(shipped.rig, "tread"))
    rig.payload = carried
    start = np.array(rig.row.start_q)
    rig.backend.loop_client = TurnedWrist(
        rig.clock, start, lambda q: seen(rig.model.plate_pose(q)[1])
    )
    return context


def weighed(carried, degrees=0.0):
    """Force at a sensor that was turned about z since its calibration, by rotation."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    turned = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    return lambda rotation: BIAS[:3] + turned @ carried.weight(rotation)[:3]


def test_a_mounting_whose_weight_turns_with_the_wrist_is_verified(tmp_path, capsys):
    carried = payload(0.45)
    context = wrist(tmp_path, carried, weighed(carried))
    verify_mounting(context)
    out = capsys.readouterr().out
    assert f"{GOOD} mounting verified: 0.0 N off (limit 1.0)" in out
    assert out.index("clear the space") < out.index("mounting verified")
    assert out.rstrip().endswith("Take the arm again. [space]")
    start = np.array(context.rig.row.start_q)
    assert context.loop_client.position == pytest.approx(start)


@pytest.mark.parametrize(("limit", "is_verified"), [(0.5, True), (0.499, False)])
def test_the_measured_weight_may_be_off_by_the_limit_and_no_more(
    tmp_path, limit, is_verified
):
    """The sensor shows half a newton for a weightless foot in the second pose."""

    def seen(rotation):
        is_tilted = rotation[2, 2] > 0.7
        return np.array([0.5 * is_tilted, 0.0, 0.0])

    context = wrist(tmp_path, payload(0.0), seen, residual=limit)
    if is_verified:
        verify_mounting(context)
        return
    with pytest.raises(PreflightError, match=r"0\.5 N"):
        verify_mounting(context)


def test_a_light_foot_on_a_turned_sensor_is_refused_within_the_limit(tmp_path):
    carried = payload(0.2)
    verify_mounting(wrist(tmp_path / "a", carried, weighed(carried, 8.0)))
    with pytest.raises(PreflightError, match=r"turned by -?30 degrees"):
        verify_mounting(wrist(tmp_path / "b", carried, weighed(carried, 30.0), 5.0))


def test_a_real_sensor_of_unknown_bias_is_tared_without_a_residual(tmp_path, capsys):
    context = lifted(tmp_path, residual=0.1)
    context.rig.is_simulated = False
    context.loop_client.force = lambda s: 3.0
    take_tare(context, TrialName(1, 1))
    assert context.loop_client.bias[0] == pytest.approx(3.0)
    assert "Lift the foot" in capsys.readouterr().out
