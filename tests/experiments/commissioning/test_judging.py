import numpy as np
import pytest

from acquisition.control_loop.faults import CircuitCauses, Fault, verdict_for
from acquisition.devices import SafetyMode
from acquisition.errors import SettingsError
from experiments.commissioning import (
    bus,
    configuration,
    manual_joints,
    rest_pose,
    stop_circuit,
)
from experiments.commissioning.judging import LIMITS
from experiments.commissioning.recording import read_raw, texts, write_raw
from wam.model.constants import load_constants

CONSTANTS = load_constants()
EXCHANGE = {
    "unasked": np.array(5),
    "late": np.array(0),
    "jumps": np.array(0),
    "answer_ns": np.array(290_000),
    "cycles": np.array(30_000),
    "incomplete": np.array(0),
}


def test_a_sound_exchange_passes():
    assert bus.judge_timing(EXCHANGE).cause == ""


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("late", 2, "earlier request"),
        ("answer_ns", 2_290_000, "adapter is slow"),
        ("incomplete", 13, "Frames are lost"),
        ("unasked", 0, "Too few"),
    ],
)
def test_a_faulty_exchange_is_reported(name, value, words):
    wrong = {**EXCHANGE, name: np.array(value)}
    assert words in bus.judge_timing(wrong).cause


def turned(joint=0, off=0.0, scale=1.0):
    low, high = np.zeros((7, 7)), np.zeros((7, 7))
    np.fill_diagonal(low, CONSTANTS.q_lower)
    np.fill_diagonal(high, CONSTANTS.q_upper)
    for row in (low, high):
        row[joint, joint] = scale * row[joint, joint] + off
    ends = {"q_lower": CONSTANTS.q_lower, "q_upper": CONSTANTS.q_upper}
    return {"low": low, "high": high, **ends}


def test_joints_that_stop_at_their_limits_pass():
    assert manual_joints.judge(turned()).cause == ""


@pytest.mark.parametrize(
    ("values", "words"),
    [
        (turned(1, off=np.radians(5.0)), "joint 2 on its stop"),
        (turned(2, scale=-1.0), "sense of joint 3"),
        (turned(3, scale=0.5), "travel of joint 4"),
    ],
)
def test_a_wrong_encoder_is_reported(values, words):
    assert words in manual_joints.judge(values).cause


def test_a_joint_that_moves_with_another_is_reported():
    values = turned()
    values["high"][4, 5] = 1.0
    assert "Joint 5 was turned, joint 6 moved" in manual_joints.judge(values).cause


def pressed(*, silent_after=0):
    modes = [SafetyMode.IDLE] * 100 + [SafetyMode.E_STOP] * 1000
    modes += [SafetyMode.IDLE] * 100
    fresh = [0x7F] * (100 + silent_after) + [0] * (1100 - silent_after)
    return {
        "t_ns": np.arange(1200) * 2_000_000,
        "mode": np.array(modes, dtype=np.int64),
        "fresh": np.array(fresh),
        "seen": np.array([True] * 3),
        "early_ns": np.array(46_000_000),
        "released_ns": np.array(1_000_000_000),
        "idled_ns": np.array(2_190_000_000),
    }


def test_a_sound_stop_passes_and_one_that_leaves_the_power_on_fails():
    assert stop_circuit.judge(pressed()).cause == ""
    assert "stop button" in stop_circuit.judge(pressed(silent_after=200)).cause


def test_a_module_that_does_not_return_to_idle_in_time_is_reported():
    sound = pressed()
    mode, t_ns = sound["mode"].copy(), sound["t_ns"].copy()
    mode[20] = SafetyMode.ACTIVE
    assert stop_circuit.judge({**sound, "mode": mode}).cause == ""
    # Nothing is recorded while the module is asked; its heartbeat brakes it at last.
    t_ns[21:] += 98_000_000
    late = {**sound, "mode": mode, "t_ns": t_ns}
    late |= {name: sound[name] + 98_000_000 for name in ("released_ns", "idled_ns")}
    assert "does not go back to idle" in stop_circuit.judge(late).cause
    mode[20:26] = SafetyMode.ACTIVE
    assert "does not go back" in stop_circuit.judge({**sound, "mode": mode}).cause


def test_a_module_braked_by_its_heartbeat_only_is_reported():
    sound = pressed()
    for pause_ns, is_named in ((4_000_000, False), (104_000_000, True)):
        t_ns = sound["t_ns"].copy()
        t_ns[21:] += pause_ns
        times = {name: sound[name] + pause_ns for name in ("released_ns", "idled_ns")}
        seen = {**sound, **times, "t_ns": t_ns}
        seen |= {"early_ns": t_ns[21] + 4_000_000}  # the module reports it then
        cause = stop_circuit.judge(seen).cause
        assert ("does not go back to idle" in cause) is is_named, cause
    # A pause at another time does not concern the module.
    far = {**seen, "early_ns": np.array(2_000_000_000)}
    assert stop_circuit.judge(far).cause == ""


def test_an_unusual_setting_is_reported():
    values = {
        "unusual": texts(["rig.toml: loop.test_time = 0.5"]),
        "load": np.array(1.0),
        "gravity_apart": np.zeros(3),
    }
    assert "loop.test_time = 0.5" in configuration.judge(values).cause
    assert configuration.judge({**values, "unusual": texts([])}).cause == ""


def test_an_arm_that_moves_without_torque_is_reported():
    q = np.tile(CONSTANTS.home, (500, 1))
    values = {"t_ns": np.arange(500) * 2_000_000, "q": q, "ended": texts([])}
    assert rest_pose.judge_rest(values).cause == ""
    q[-1, 2] += 0.016
    assert "travel of joint 3" in rest_pose.judge_rest(values).cause


@pytest.mark.parametrize(
    ("braked_ms", "is_sound"), [(100, True), (148, True), (152, False), (None, False)]
)
def test_a_module_must_brake_an_arm_without_requests_in_time(braked_ms, is_sound):
    t_ns = np.arange(500) * 2_000_000
    mode = np.full(500, int(SafetyMode.ACTIVE))
    fresh = np.where(np.arange(500) < 10, 0x7F, 0)  # the last one at 18 ms
    if braked_ms is not None:
        mode[t_ns >= (18 + braked_ms) * 1_000_000] = SafetyMode.IDLE
    fresh[-100:] = 0x7F  # asked again
    values = {
        "t_ns": t_ns,
        "q": np.tile(CONSTANTS.home, (500, 1)),
        "ended": texts([]),
        "silent_ns": t_ns,
        "silent_mode": mode,
        "silent_fresh": fresh,
    }
    cause = rest_pose.judge_rest(values).cause
    assert (cause == "") is is_sound
    assert is_sound or "until the module idles" in cause


@pytest.mark.parametrize(
    ("fault", "causes", "is_heartbeat"),
    [
        (Fault.PENDANT_IDLE, ("heartbeat",), True),
        (Fault.PENDANT_IDLE, (), False),  # a person pressed Shift-idle
        (Fault.PENDANT_IDLE, ("velocity",), False),
        (Fault.E_STOP, ("heartbeat",), False),  # the positions are lost
        (Fault.POWERED_TEST_MOTION, (), False),
    ],
)
def test_only_a_heartbeat_fault_counts_as_the_heartbeat(fault, causes, is_heartbeat):
    verdict = verdict_for(fault, CircuitCauses(causes))
    assert rest_pose.is_heartbeat(verdict) is is_heartbeat


def lifted(share, reach=0.08, friction=1.0, top=0):
    """Recording of joint 2 with `share` of its predicted weight.

    Args:
        share: weight over the predicted one.
        reach: travel [rad].
        friction: [N m].
        top: cycles that the joint rests at its top; friction still acts downwards.
    """
    up, n = np.linspace(0.0, reach, 400), 800 + top
    lift = np.concatenate([up, np.full(top, reach), up[::-1]])
    q, tau, predicted = np.tile(CONSTANTS.home, (n, 1)), *np.zeros((2, n, 7))
    q[:, 1] += lift
    predicted[:, 1] = 18.7
    tau[:, 1] = 18.7 * share + friction * np.where(np.arange(n) < 400 + top, 1, -1)
    return {
        "proof": np.zeros(n),
        "joints": np.array([2]),
        "torques": np.array([25.0]),
        "q": q,
        "tau": tau,
        "predicted": predicted,
        "ended": texts([]),
    }


@pytest.mark.parametrize(
    ("share", "is_sound"),
    [(1.0, True), (0.9, True), (1.1, True), (0.88, False), (1.17, False)],
)
def test_the_weight_on_a_joint_must_agree_with_the_prediction(share, is_sound):
    cause = rest_pose.judge_lift(lifted(share)).cause
    assert (cause == "") is is_sound
    assert is_sound or cause.startswith("weight on joint 2")


@pytest.mark.parametrize("reach", [0.061, 0.08, 0.1])
def test_the_rest_at_the_top_of_a_lift_is_left_out_of_the_weight(reach):
    assert rest_pose.judge_lift(lifted(1.0, reach, friction=4.0, top=2000)).cause == ""


def test_a_recording_is_read_as_written_or_refused(tmp_path):
    raw = write_raw(tmp_path, "one.npz", {"q": np.arange(3.0), "t": texts(["a"])})
    arrays = read_raw(tmp_path, raw)
    assert arrays["q"].tolist() == [0.0, 1.0, 2.0]
    (tmp_path / "one.npz").write_bytes(b"other")
    with pytest.raises(SettingsError, match="not what was recorded"):
        read_raw(tmp_path, raw)


def test_every_limit_has_values_words_and_a_source():
    for name, limit in LIMITS.items():
        assert limit.name, name
        assert limit.wrong, name
        assert limit.source, name
        if limit.low is None and limit.high is None:
            assert "computed" in limit.source, name
